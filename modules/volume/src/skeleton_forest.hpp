// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "skeleton_cycles.hpp"

namespace angio::volume {

/// Voxels of a skeleton, linked to trees: a graph without loops.
struct SkeletonForest : SkeletonGraph {
  std::vector<SkeletonRepair> repairs;  ///< What was done to get it.
};

/// The graph without its loops (cutCycles). Where voxels touch more neighbours than a tree needs, the widest ways stay.
SkeletonForest linked(SkeletonGraph graph, KissingRule kissing, const std::optional<Eigen::Vector3d>& root);

/// Without side branches that reach less than `shortest` [voxels], or less than `radii` times the depth of where they
/// begin, out of the vessel they begin in; and without those that are wider than that vessel and no longer than they
/// are wide, as an aneurysm is.
SkeletonForest withoutSpurs(const SkeletonForest& forest, double shortest, double radii);

/// Without trees of less than `shortest` length in all [voxels].
SkeletonForest withoutSmallTrees(const SkeletonForest& forest, double shortest);

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
