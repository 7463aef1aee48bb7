// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/volume/level_field.hpp"
#include "skeleton_forest.hpp"

namespace angio::volume {

/// Wavelengths below which a centreline's waves are noise: the larger counts.
struct Smoothness {
  double voxels = 6;
  double radii = 3;
};

/// A path of points between voxels [index of the volume].
struct CenteredPath {
  std::vector<Eigen::Vector3d> points;  ///< The first one is a point of the parent's path, too.
  int parent = -1;
  int parent_place = 0;
};

/// Moves the nodes of paths to the middle of their vessel's cross-sections, smooths them, and brings their ends to the
/// vessel's wall: thinning leaves ends that stop short of it or turn off into its corners.
std::vector<CenteredPath> centered(const LevelField& level, const SkeletonForest& forest,
                                   const std::vector<SkeletonPath>& paths, const Smoothness& smoothness);

}  // namespace angio::volume
