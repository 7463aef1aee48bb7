// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/localisation/sequence_localiser.hpp"
#include "place_grid.hpp"

namespace angio::localisation {

/// One point of a curve and its place on the tree.
struct PosedPoint {
  Eigen::Vector2d seen_px = Eigen::Vector2d::Zero();
  int place = 0;                                          ///< On the edge from this place to its parent,
  double weight = 0;                                      ///< this far along it.
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();  ///< [px^-2].
};

/// One frame as the common pose sees it.
struct PosedFrame {
  SeenPose pose;  ///< Without the correction.
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
  std::vector<PosedPoint> points;
};

/// What all frames share.
struct SharedFit {
  Pose correction = Pose::Identity();
  Eigen::Matrix3Xd displacements_m;  ///< Of the grid's places.
};

/// Gauss-Newton for the common correction (about `centre_m`), the displacements of the vessels the catheter lies in,
/// and each frame's shift, with the settings' priors. Displacements stay as they are when `settings.deformation_std_mm`
/// is 0.
void fitShared(std::vector<PosedFrame>& frames, const std::vector<int>& tips, const PlaceGrid& grid,
               const Eigen::Vector3d& center_m, const SequenceSettings& settings, SharedFit& shared);

}  // namespace angio::localisation
