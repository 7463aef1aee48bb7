// SPDX-License-Identifier: GPL-2.0-or-later
#include "route_view.hpp"

#include <algorithm>
#include <vector>

namespace angio::navigation {

std::optional<RouteView> viewRoute(const TreeTopology& map, int target_branch, const TipBelief& belief, double near_m) {
  const TipPlace& tip = belief.tip;
  const std::vector<int> taken = map.pathTo(tip.branch), route = map.pathTo(target_branch);
  std::size_t common = 0;
  while (common < taken.size() && common < route.size() && taken[common] == route[common]) ++common;
  if (common == 0) return std::nullopt;

  RouteView view;
  view.branch = route[common - 1];
  view.on_route = common == taken.size();
  if (common < route.size()) view.next = route[common];
  if (!view.on_route) view.entered = taken[common];
  view.to_fork_m = map.start_m(view.branch) + map.length_m(view.branch) - (map.start_m(tip.branch) + tip.arc_m);
  view.probability = tip.probability;
  if (view.entered) view.beside_probability = tip.probability;
  for (const TipPlace& other : belief.alternatives) {
    const bool near = (other.tip_model - tip.tip_model).norm() < near_m;
    const bool same_branch = view.entered && map.passes(other.branch, *view.entered);
    if (near || same_branch) view.probability += other.probability;
    if (same_branch) view.beside_probability += other.probability;
  }
  view.probability = std::min(view.probability, 1.0);
  return view;
}

double throughProbability(const TreeTopology& map, int branch, const TipBelief& belief, double near_m) {
  const bool through = map.passes(belief.tip.branch, branch);
  double probability = through ? belief.tip.probability : 0.0;
  for (const TipPlace& other : belief.alternatives) {
    const bool same = through && (other.tip_model - belief.tip.tip_model).norm() < near_m;
    if (same || map.passes(other.branch, branch)) probability += other.probability;
  }
  return std::min(probability, 1.0);
}

}  // namespace angio::navigation
