// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/registration/result.hpp"
#include "angio/registration/xray_view.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::registration {

/// When a point counts as explained.
struct AlignmentScoreGate {
  double distance_px = 3;
  double angle_rad =
      0.5;  ///< Between undirected tangents; 0.5 rad is 29 deg: noisy tangents pass, crossing vessels do not.
};

/// Compares the projected model with what the views show under a pose, which is the first view's. `points_model` are
/// the tree's points, displaced or not, 3 x N [m]; only the tree's connections are taken from `tree`.
///
/// Every point of every view counts once. Only what a view sees of the model counts (detector and collimator); image
/// points of a view that should show nothing of the model are unexplained, and so are model points where a view shows
/// nothing. Residuals are over the points that have another side to be measured to.
AlignmentScore alignmentScore(const VesselTree& tree, const Eigen::Matrix3Xd& points_model, const XrayViews& views,
                              const Pose& T_camera_model, const AlignmentScoreGate& gate = {});

/// One view.
inline AlignmentScore alignmentScore(const VesselTree& tree, const Eigen::Matrix3Xd& points_model,
                                     const Centerline2d& centerline, const XrayCamera& camera,
                                     const Pose& T_camera_model, const AlignmentScoreGate& gate = {}) {
  return alignmentScore(tree, points_model, {XrayView{centerline, camera}}, T_camera_model, gate);
}

}  // namespace angio::registration
