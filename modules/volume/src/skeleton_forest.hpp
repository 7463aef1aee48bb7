// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "angio/volume/volume.hpp"
#include "nearest_point.hpp"

namespace angio::volume {

/// Voxels of a skeleton, linked to trees. Positions are indices of a volume of equal voxels, lengths in voxels.
struct SkeletonForest {
  std::vector<Eigen::Vector3d> nodes;
  std::vector<double> depths;           ///< Distance to the wall.
  std::vector<std::vector<int>> links;  ///< Neighbours of each node; no loops.
  int cycles_cut = 0;                   ///< Loops that the skeleton had.
};

/// Links neighbouring voxels by the widest ways: of every loop the link with the smallest depth is left out.
SkeletonForest linked(const VoxelMask& skeleton, const NearestPoint& wall);

/// Without side branches that reach less than `shortest` [voxels], or less than `radii` times the depth of where they
/// begin, out of the vessel they begin in.
SkeletonForest withoutSpurs(const SkeletonForest& forest, double shortest, double radii);

/// Without trees of less than `shortest` length in all [voxels]; counts them in `dropped`.
SkeletonForest withoutSmallTrees(const SkeletonForest& forest, double shortest, int& dropped);

/// A way through a tree from a fork (or the root) to an end.
struct SkeletonPath {
  std::vector<int> nodes;  ///< The first one is a node of the parent's path, too.
  int parent = -1;         ///< Path it leaves, -1 when it begins at a root.
  int parent_place = 0;    ///< Place of the first node in that path.
};

/// All trees as paths, parents first, the longest way first at each fork. Trees are rooted at their thickest end; the
/// one that is nearest to `root` (an index), when given, at the end nearest to it.
std::vector<SkeletonPath> pathsOf(const SkeletonForest& forest, const std::optional<Eigen::Vector3d>& root);

}  // namespace angio::volume
