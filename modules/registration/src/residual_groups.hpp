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

/// How points are grouped.
struct Grouping {
  int most;           ///< About so many groups; fewer where little matches.
  double reach_m;     ///< A point further than this from a group's mean place begins another group ...
  double alike;       ///< ... as does one whose normal makes an angle of a smaller cosine with the group's.
  std::size_t least;  ///< Groups of fewer points are left out.
  /// What a residual would be without displacement: as the mean place sees it, or as each point does, in the mean. In
  /// one view the former draws depth from the belief, to which it should be left.
  bool of_mean_place;
};
/// As few as say what a rigid fit is off by, and what the frame of one shows among others.
inline constexpr Grouping kCoarseGroups{64, 15e-3, 0.5, 8, false};
/// What the frame of a deformed fit shows among others, which are taken from elsewhere.
inline constexpr Grouping kFrameGroups{64, 10e-3, 0.8, 8, true};
/// For a deformation that follows them in one view ...
inline constexpr Grouping kOneViewGroups{400, 15e-3, 0.5, 8, false};
/// ... and in several, or across the beam of a view whose pose is held. Displacements and gradients change along a
/// vessel, and the mean of their products is not the product of their means: of brains deformed by 5 mm groups that
/// reach 15 mm are 1.5 px off (rms), 10 mm 0.9 px.
inline constexpr Grouping kViewsGroups{1000, 10e-3, 0.8, 3, true};

/// Returns the residuals in groups along the vessels.
///
/// @param displaced     The model's points where the matches were made, about the centroid, 3 x N [m].
/// @param tolerance_px  A point's weight is exp(-r^2 / 2 tolerance^2).
std::vector<ResidualGroup> residualGroups(const std::vector<MatchedView>& views, const OrientedModel& model,
                                          const Eigen::Matrix3Xd& displaced, double tolerance_px,
                                          const Grouping& grouping);

}  // namespace angio::registration
