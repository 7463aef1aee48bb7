// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/vessel/centerline2d.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio {

/// The vessels near a point of a tree, and how far the image shows them from where a rigid registration puts them.
class LocalShift {
 public:
  /// @param near_m  Around the target [m]. @param prior_std_m  How far the place may lie from where it is put, per
  /// axis.
  LocalShift(const VesselTree& tree, const Eigen::Vector3d& target_model, double near_m, double prior_std_m);

  struct Result {
    Eigen::Vector2d shift_px;       ///< From the projected to the seen place.
    Eigen::Matrix2d covariance_px;  ///< Along a single straight vessel nothing is seen: the prior's, there.
  };

  /// Nothing when no vessel near the target is in the image and in the picture.
  std::optional<Result> look(const Centerline2d& centerline, const XrayCamera& camera,
                             const Pose& T_camera_model) const;

 private:
  Eigen::Matrix3Xd points_, tangents_;  // Model frame, within near_m, about kSpacing_m apart.
  Eigen::VectorXd weight_;              // By distance from the target.
  Eigen::Vector3d target_;
  double prior_std_m_;
};

}  // namespace angio
