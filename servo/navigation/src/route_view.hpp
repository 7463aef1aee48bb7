// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/localisation/tip_belief.hpp"
#include "angio/navigation/namespace.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::navigation {

constexpr int kSteadyFrames = 3;  ///< What only fewer frames say may be one bad frame.

/// A belief about a tip, relative to a route.
struct RouteView {
  bool on_route = false;          ///< The tip's branch leads to the target, or is its own.
  int branch = 0;                 ///< The last branch of the route that the tip has come through or is in.
  std::optional<int> next;        ///< The branch of the route behind it; nothing in the target's own branch.
  std::optional<int> entered;     ///< The child of `branch` that it has entered although it is not on the route.
  double to_fork_m = 0;           ///< From the tip to the end of `branch`; negative beyond it.
  double probability = 0;         ///< That the tip is about here: of all places that agree.
  double beside_probability = 0;  ///< That it is in the branch it has entered beside the route.
};

/// Nothing when the tip's tree is not the target's. Alternatives that are nearer to the believed place than `near_m`
/// [m] or in the same branch of the fork agree with it.
std::optional<RouteView> viewRoute(const TreeTopology& map, int target_branch, const TipBelief& belief, double near_m);

/// Probability that the tip has come through a branch, or is in it. Alternatives nearer to the believed place than
/// `near_m` [m] are it.
double throughProbability(const TreeTopology& map, int branch, const TipBelief& belief, double near_m);

}  // namespace angio::navigation
