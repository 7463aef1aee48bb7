// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/xray_camera.hpp"
#include "angio/registration/result.hpp"
#include "angio/vessel/centerline2d.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio {

/// When a point counts as explained.
struct AgreementGate {
  double distance_px = 3;
  double angle_rad = 0.5;  ///< Between undirected tangents; 0.5 rad is 29 deg: noisy tangents pass, crossing vessels do not.
};

/// Compares the projected model with the image's centreline under a pose. `points_model` are the tree's points, displaced or
/// not, 3 x N [m]; only the tree's connections are taken from `tree`.
Agreement agreementOf(const VesselTree& tree, const Eigen::Matrix3Xd& points_model, const Centerline2d& centerline,
                      const XrayCamera& camera, const Pose& T_camera_model, const AgreementGate& gate = {});

}  // namespace angio
