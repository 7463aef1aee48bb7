// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/navigation/namespace.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::navigation {

/// How a tip is to point in front of a fork.
struct ForkPlan {
  double angle_rad = 0;   ///< Of the tip in the vessel's frame at the fork, from `normal` to `binormal`.
  double bend_rad = 0;    ///< Between the tip and the vessel.
  double margin_rad = 0;  ///< By how much it points nearer to the wanted branch than to any other; may be negative.
};

/// What tips a catheter can make [rad].
struct TipRange {
  double min_bend_rad = 0;
  double max_bend_rad = 0;
};

/// The directions in which a fork's branches leave it: unit vectors, model frame.
struct Fork {
  TreeFrame frame;  ///< Of the vessel that ends there.
  Eigen::Vector3d goal;
  std::vector<Eigen::Vector3d> others;
};

/// The fork in front of `wanted`. Branches leave it as the chords of the first `lever_m` [m] of their routes, or more
/// until those have parted. A short one goes on as its own children do, the wanted one towards the branch `towards`.
Fork forkAt(const TreeTopology& map, int wanted, int towards, double lever_m);

/// From the next branch towards the wanted one, across the vessel that ends at the fork: normal, binormal; length 1, or
/// zero where there is no other branch.
Eigen::Vector2d sideTowards(const Fork& fork);

/// Direction in which a route through a child leaves its parent, in the parent's frame at the fork: normal, binormal.
/// Its length is the sine of the angle. Where several routes lead through the child, it is the one to `towards`.
Eigen::Vector2d sidewaysOf(const TreeTopology& map, int child, int towards, double lever_m);

/// The tip that points nearer to the wanted child than to its siblings by the widest margin, when its angle is only
/// known to `std_rad`; with several wanted branches, of forks that follow each other closely, the least of their
/// margins counts: a tip that only slides keeps its angle in the vessel's frame. Children leave as in forkAt(), the
/// wanted ones towards `target`.
ForkPlan planForks(const TreeTopology& map, const std::vector<int>& wanted, int target, const TipRange& range,
                   double std_rad, double lever_m);

}  // namespace angio::navigation
