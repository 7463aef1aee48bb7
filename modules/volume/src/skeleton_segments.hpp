// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "skeleton_graph.hpp"

namespace angio::volume {

/// A chain of voxels from one junction to another, or back to the same one.
struct Segment {
  int from = 0, to = 0;      ///< Junctions.
  std::vector<int> nodes;    ///< The first is one of `from`, the last one of `to`; at least one lies between.
  std::size_t thinnest = 1;  ///< Place in `nodes` of the least depth between the junctions.
  double length = 0;         ///< Along the nodes [voxels].
};

/// A skeleton as segments between junctions. A junction is a group of voxels that touch each other and have not two
/// neighbours each: a fork or an end. What is no junction has one way in and one way out.
struct SkeletonSegments {
  std::vector<std::vector<int>> junctions;  ///< Their nodes.
  std::vector<Segment> segments;
};

SkeletonSegments segmentsOf(const SkeletonGraph& graph);

/// Which of the segments are contacts, where two vessels only touch: thinner than both of them, not much longer than
/// the largest spheres at its ends, and leaving two vessels sideways that run straight on. Of two that could each be
/// the way of the other's vessel the thinner one is.
std::vector<bool> contactsOf(const SkeletonGraph& graph, const SkeletonSegments& skeleton);

}  // namespace angio::volume
