// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>

#include "angio/registration/registration.hpp"

namespace angio::registration {

/// "Iterative PnP and its application in 3D-2D vascular image registration for robot navigation" (Song et al.):
/// nearest neighbours on the image side, Gaussian-kernel weights, Levenberg-Marquardt on SE(3), rigid then nonrigid.
std::unique_ptr<Registration> make(const IterativePnpSettings& settings, const VesselTree& tree);

/// NICP, "Registration and analysis of vascular images" (Aylward et al. 2003): ascends the weighted mean of the image's
/// blurred centreline at the projected model, coarse to fine. Rigid.
std::unique_ptr<Registration> make(const NicpSettings& settings, const VesselTree& tree);

/// Oriented kernel fields with many starts, and a point-to-line polish from image to model.
std::unique_ptr<Registration> make(const OrientedKernelSettings& settings, const VesselTree& tree);

/// Gradients at the vessels' silhouettes against those of the X-ray image, and a motion most of them agree on.
std::unique_ptr<Registration> make(const RgrbSettings& settings, const VesselTree& tree);

/// Radiographs of the tree against the X-ray image, inside a mask.
std::unique_ptr<Registration> make(const AutoMaskSettings& settings, const VesselTree& tree);

/// A network's answer to a picture of the image and one of the tree, until it says that nothing moves.
std::unique_ptr<Registration> make(const PairwiseDnnSettings& settings, const VesselTree& tree);

/// Continuous visual odometry (Ghaffari, Clark et al.): the distance of model and image in a reproducing kernel Hilbert
/// space, lowered by a gradient flow on SE(3); rigid.
std::unique_ptr<Registration> make(const CvoSettings& settings, const VesselTree& tree);

/// "Nonrigid 2D/3D registration of coronary artery models" (Rivest-Henault et al.) as the paper compares with it: the
/// distance transform of the image's centreline at every projected point; affine, rigid, then nonrigid.
std::unique_ptr<Registration> make(const DtIcpSettings& settings, const VesselTree& tree);

}  // namespace angio::registration
