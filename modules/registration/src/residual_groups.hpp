// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

struct LineMatches;
struct OrientedModel;
struct OrientedPoints;

/// Image points that follow each other along a vessel, as one observation: weighted means over them.
struct ResidualGroup {
  Eigen::Vector3d at = Eigen::Vector3d::Zero();        ///< Matched place on the model, about the centroid [m].
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();  ///< Of the residual by a displacement there, model axes [px/m].
  Vector6d jacobian = Vector6d::Zero();                ///< Of the residual by the twist about the centroid.
  double residual_px = 0;                              ///< Across the vessel, of the tree without displacement.
  double scatter_px2 = 0;                              ///< Variance of the points' residuals about their mean.
  double weight = 0;                                   ///< Sum of the points' weights.
  double pull = 0;  ///< The same, with the group's part of the points that are in no group.

  /// Where the points are in the image, and the direction across the vessel there [px].
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero(), normal = Eigen::Vector2d::Zero();
};

/// The image points of a view, as they have been matched.
struct MatchedView {
  const XrayCamera& camera;
  Pose T_view_centered;
  const OrientedPoints& image;
  const LineMatches& matches;
};

/// Returns the residuals in about `most` groups along the vessels; fewer where little matches.
///
/// @param displaced     The model's points where the matches were made, about the centroid, 3 x N [m].
/// @param tolerance_px  A point's weight is exp(-r^2 / 2 tolerance^2).
std::vector<ResidualGroup> residualGroups(const std::vector<MatchedView>& views, const OrientedModel& model,
                                          const Eigen::Matrix3Xd& displaced, double tolerance_px, int most);

}  // namespace angio::registration
