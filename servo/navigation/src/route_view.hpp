// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/localisation/tip_belief.hpp"
#include "angio/navigation/namespace.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::navigation {

constexpr int kSteadyFrames = 3;  ///< What only fewer frames say may be one bad frame.

/// A belief about a tip as one sees it who has a way to go.
struct RouteView {
  bool on_route = false;          ///< The tip's chain leads to the target, or is its own.
  int chain = 0;                  ///< The last chain of the route that the tip has come through or is in.
  std::optional<int> next;        ///< The chain of the route behind it; nothing in the target's own chain.
  std::optional<int> entered;     ///< The child of `chain` that it has entered although it is not on the route.
  double to_fork_m = 0;           ///< From the tip to the end of `chain`; negative beyond it.
  double probability = 0;         ///< That the tip is about here: of all places that agree.
  double beside_probability = 0;  ///< That it is in the branch it has entered beside the route.
};

/// Nothing when the tip's tree is not the target's. Alternatives that are nearer to the believed place than `near_m`
/// [m] or in the same branch of the fork agree with it.
std::optional<RouteView> viewRoute(const TreeTopology& map, int target_chain, const TipBelief& belief, double near_m);

/// Probability that the tip has come through a chain, or is in it. Alternatives nearer to the believed place than
/// `near_m` [m] are it.
double throughProbability(const TreeTopology& map, int chain, const TipBelief& belief, double near_m);

}  // namespace angio::navigation
