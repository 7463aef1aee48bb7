// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/navigation/namespace.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::navigation {

/// How a tip is to point in front of a fork.
struct ForkPlan {
  double angle_rad = 0;  ///< Of the tip in the vessel's frame at the fork, from `across` to `aside`.
  double bend_rad = 0;   ///< Between the tip and the vessel.
  double margin_rad =
      0;  ///< By how much it then points nearer to the wanted branch than to any other; may be negative.
};

/// What tips a catheter can make [rad].
struct TipRange {
  double min_bend_rad = 0;
  double max_bend_rad = 0;
};

/// The tip that points nearer to the wanted child than to its siblings by the widest margin, when its angle is only
/// known to `std_rad`; with several wanted chains, of forks that follow each other closely, the least of their
/// margins counts: a tip that only slides keeps its angle in the vessel's frame.
///
/// Children leave a fork as the chords of the first `lever_m` [m] of their ways, or more until those have parted: one
/// that is short goes on as its own children do, and the wanted ones towards `target`.
ForkPlan planForks(const TreeTopology& map, const std::vector<int>& wanted, int target, const TipRange& range,
                   double std_rad, double lever_m);

/// Direction in which a way through a child leaves its parent, in the parent's frame at the fork: across, aside; sine
/// of the angle long. The way towards `towards`, where several lead through the child.
Eigen::Vector2d sidewaysOf(const TreeTopology& map, int child, int towards, double lever_m);

}  // namespace angio::navigation
