// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "angio/volume/extract_tree.hpp"
#include "skeleton_graph.hpp"

namespace angio::volume {

/// A flaw of a skeleton and what was done about it: Repair, with a place as an index of the volume and lengths in
/// voxels.
struct SkeletonRepair {
  Flaw flaw = Flaw::kCycle;
  Eigen::Vector3d at = Eigen::Vector3d::Zero();
  double length = 0, radius = 0;
};

/// Cuts every loop of a skeleton once, between two junctions. A loop that closes where vessels only touch is cut there.
/// Any other is cut where it is thinnest; of places that are as thin, to half a voxel, at the one farthest from the
/// root, so that blood takes the shortest way to both sides. Contacts of vessels that are not connected otherwise are
/// cut unless `kissing` says to keep them. Loops of a few voxels within a junction stay.
std::vector<SkeletonRepair> cutCycles(SkeletonGraph& graph, KissingRule kissing,
                                      const std::optional<Eigen::Vector3d>& root);

}  // namespace angio::volume
