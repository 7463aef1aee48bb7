// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "angio/volume/volume.hpp"
#include "nearest_point.hpp"

namespace angio::volume {

/// Voxels of a skeleton and what links them. Positions are indices of a volume of equal voxels, lengths in voxels.
struct SkeletonGraph {
  std::vector<Eigen::Vector3d> nodes;
  std::vector<double> depths;           ///< Distance to the wall.
  std::vector<std::vector<int>> links;  ///< Neighbours of each node.
  std::vector<bool> cut;                ///< A loop or a contact was cut here: no end of a vessel.
  std::vector<bool> fork;               ///< A vessel that was cut began here.
  std::vector<bool> root;               ///< The piece begins here; at most one of each.
};

inline double lengthOf(const SkeletonGraph& graph, int a, int b) { return (graph.nodes[a] - graph.nodes[b]).norm(); }

/// Links all voxels that touch each other: there are loops.
SkeletonGraph graphOf(const VoxelMask& skeleton, const NearestPoint& wall);

/// The connected pieces of a graph, each with its nodes.
std::vector<std::vector<int>> piecesOf(const SkeletonGraph& graph);

/// Which of the pieces has the node nearest to `place`.
std::size_t nearestPiece(const SkeletonGraph& graph, const std::vector<std::vector<int>>& pieces,
                         const Eigen::Vector3d& place);

/// Where a piece begins: its root, if it has one; else its thickest end, or the one nearest to `root`. Where the graph
/// was cut it does not, unless there is no other end; then any node will do.
int rootOf(const SkeletonGraph& graph, const std::vector<int>& piece, const std::optional<Eigen::Vector3d>& root);

/// Marks the nodes at which the pieces of another graph of the same voxels begin.
void markRoots(const SkeletonGraph& other, const std::optional<Eigen::Vector3d>& root, SkeletonGraph& graph);

}  // namespace angio::volume
