// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/calibration/bead_phantom.hpp"
#include "angio/calibration/camera_calibration.hpp"
#include "angio/calibration/direct_linear.hpp"

namespace angio::calibration {

/// What one view says by itself, without K.
struct ViewProjection {
  Matrix34d P = Matrix34d::Zero();                  ///< Of a phantom with depth.
  Eigen::Matrix3d H = Eigen::Matrix3d::Identity();  ///< Of a flat one, from the axes of its plane.
  std::vector<bool> fits;                           ///< One a bead of the view.
};

/// Finds the projection that most of a view's beads agree on, to a hundredth of the detector's width: enough to tell
/// beads apart, wide enough for a detector's distortion. Throws InputError that names view and beads when two are
/// swapped, when fewer than `min_share` agree, and when the beads leave the projection open.
///
/// @param plane  A flat phantom's own frame, whose z is the plane's normal; absent for one with depth.
ViewProjection projectionOf(const BeadPhantom& phantom, const BeadView& view, double detector_width_px,
                            double min_share, const std::optional<Pose>& T_plane_phantom);

}  // namespace angio::calibration
