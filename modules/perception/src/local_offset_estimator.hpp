// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/geometry/xray_camera.hpp"
#include "angio/perception/point_of_interest.hpp"
#include "angio/vessel/centerline2d.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::perception {

/// The vessels near a place of a tree, and how far the image shows them from where a rigid registration puts them.
class LocalOffsetEstimator {
 public:
  LocalOffsetEstimator(const VesselTree& tree, const PointOfInterest& place);

  /// Nothing when no vessel near the place is in the image and in the picture.
  std::optional<ImageShift> observe(const Centerline2d& centerline, const XrayCamera& camera,
                                    const Pose& T_camera_model) const;

 private:
  Eigen::Matrix3Xd points_, tangents_;  // Model frame, within near_m, about kSpacing_m apart.
  Eigen::VectorXd weight_;              // By distance from the place.
  PointOfInterest place_;
};

}  // namespace angio::perception
