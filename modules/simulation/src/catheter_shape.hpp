// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/simulation/namespace.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::simulation {

/// The line of a catheter, 3 x N [m], tip last, where the tree's points stand at `points`: as straight as the lumen
/// lets it be, and its last `tip_length_m` leaning over to `deflected_m` at the end.
///
/// @param path  Chains from the root to the tip, which is `tip_m` along them. @param tree  With all radii known.
Eigen::Matrix3Xd catheterShape(const TreeTopology& map, const VesselTree& tree, const Eigen::Matrix3Xd& points,
                               const std::vector<int>& path, double tip_m, double radius_m, double tip_length_m,
                               const Eigen::Vector3d& deflected_m);

}  // namespace angio::simulation
