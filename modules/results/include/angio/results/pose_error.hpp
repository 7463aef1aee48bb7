// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/results/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::results {

/// mTRE below this is a success [m].
constexpr double kSuccessMtre_m = 2e-3;

/// How far an estimate is from the truth, on the points of the tree. Displacements are 3 x N [m] in model axes, or
/// empty for none.
struct PoseError {
  double mtre_m = 0;      ///< Mean 3D distance of the points under estimated and true pose (and deformation).
  double depth_m = 0;     ///< Mean distance along the camera's optical axis, of the same.
  double in_plane_m = 0;  ///< Mean distance parallel to the image.
  /// Mean distance across the ray from the source to the true place: all that one view shows. Depth has no part in it;
  /// in in_plane_m it has, as rays diverge.
  double across_beam_m = 0;

  /// Mean distance of corresponding projections [px]. Nothing when a point lies behind the source under one of the
  /// poses: a mean over the others would make a pose inside the X-ray tube look good.
  std::optional<double> mpd_px;
  std::optional<double> mpd_isocenter_m;  ///< The same at the depth of the tree's centroid.

  double rotation_rad = 0;  ///< Angle between the poses.
  double centroid_m = 0;    ///< Distance of the centroid under both poses.
  double source_m = 0;      ///< Distance of the camera's source under both, seen from the model.
};

/// A tree's place by an estimate or in truth: its pose, and how far its points are displaced in the model frame [m],
/// 3 x N, without columns when it is rigid.
struct PlacedTree {
  Pose T_camera_model = Pose::Identity();
  Eigen::Matrix3Xd displacements_m;
};

PoseError poseError(const VesselTree& tree, const XrayCamera& camera, const PlacedTree& estimate,
                    const PlacedTree& truth);

}  // namespace angio::results
