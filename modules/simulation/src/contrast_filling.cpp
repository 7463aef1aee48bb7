// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/contrast_filling.hpp"

#include <algorithm>
#include <numeric>
#include <optional>

namespace angio::simulation {
namespace {

// Empties branches in random order until the emptied length is as near to the share as whole branches come.
void emptyAtRandom(const std::vector<double>& length, double share, const std::vector<int>& order,
                   std::vector<bool>& filled) {
  const double whole = std::accumulate(length.begin(), length.end(), 0.0);
  double emptied = 0;
  for (const int b : order) {
    if (emptied + 0.5 * length[b] > share * whole) continue;
    emptied += length[b];
    filled[b] = false;
  }
}

// For each branch those that begin where it ends.
std::vector<std::vector<std::size_t>> nextBranches(const VesselTree& tree) {
  const auto& branches = tree.branches();
  std::vector<std::vector<std::size_t>> from_point(static_cast<std::size_t>(tree.size())), next(branches.size());
  for (std::size_t b = 0; b < branches.size(); ++b) {
    from_point[branches[b].front()].push_back(b);
  }
  for (std::size_t b = 0; b < branches.size(); ++b) next[b] = from_point[branches[b].back()];
  return next;
}

// A branch and all downstream of it, nearest first.
std::vector<std::size_t> downstreamOf(std::size_t branch, const std::vector<std::vector<std::size_t>>& next) {
  std::vector<std::size_t> found{branch};
  for (std::size_t k = 0; k < found.size(); ++k) {
    const std::size_t at = found[k];
    found.insert(found.end(), next[at].begin(), next[at].end());
  }
  return found;
}

// An index in proportion to the weights, by a number in [0, 1).
std::size_t drawn(const std::vector<double>& weights, double uniform) {
  double left = uniform * std::accumulate(weights.begin(), weights.end(), 0.0);
  std::size_t last = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (!(weights[i] > 0)) continue;
    last = i;
    if ((left -= weights[i]) < 0) break;
  }
  return last;
}

// The branch that begins nearest to a place, of those with a weight; of several the one with the largest.
std::size_t nearestTo(const Eigen::Vector3d& place, const VesselTree& tree, const std::vector<double>& weights) {
  std::size_t best = weights.size();
  double best_m = 0;
  for (std::size_t b = 0; b < weights.size(); ++b) {
    if (!(weights[b] > 0)) continue;
    const double away_m = (tree.points().col(tree.branches()[b].front()) - place).norm();
    const bool nearer = best == weights.size() || away_m < best_m;
    if (nearer || (away_m == best_m && weights[b] > weights[best])) best = b, best_m = away_m;
  }
  return best;
}

// Fills downstream of sites, among branches that are filled before.
void fillFromSites(const VesselTree& tree, const std::vector<double>& length, double share, double draw,
                   std::vector<bool>& filled) {
  const double wanted = share * std::accumulate(length.begin(), length.end(), 0.0);
  const auto next = nextBranches(tree);
  std::vector<std::vector<std::size_t>> downstream;
  for (std::size_t b = 0; b < length.size(); ++b) downstream.push_back(downstreamOf(b, next));
  const std::vector<bool> open = filled;
  std::fill(filled.begin(), filled.end(), false);
  const auto gain = [&](std::size_t b) { return open[b] && !filled[b] ? length[b] : 0.0; };
  std::optional<Eigen::Vector3d> first_site;
  for (double sum = 0; sum < wanted;) {
    std::vector<double> fits(length.size()), any(length.size());
    for (std::size_t b = 0; b < length.size(); ++b) {
      for (const std::size_t d : downstream[b]) any[b] += gain(d);
      if (sum + any[b] <= wanted) fits[b] = any[b];
    }
    const bool whole = std::any_of(fits.begin(), fits.end(), [](double f) { return f > 0; });
    if (!whole && std::none_of(any.begin(), any.end(), [](double a) { return a > 0; })) return;
    const auto& allowed = whole ? fits : any;
    const std::size_t site = first_site ? nearestTo(*first_site, tree, allowed) : drawn(allowed, draw);
    if (!first_site) first_site = tree.points().col(tree.branches()[site].front());
    for (const std::size_t d : downstream[site]) {
      if (!whole && sum + 0.5 * gain(d) > wanted) return;
      sum += gain(d);
      filled[d] = filled[d] || open[d];
    }
  }
}

}  // namespace

std::vector<bool> filledBranches(const VesselTree& tree, const std::vector<double>& length,
                                 const FillingSettings& settings, const FillingDraws& draws) {
  std::vector<bool> filled(tree.branches().size(), true);
  emptyAtRandom(length, settings.missing, draws.emptying_order, filled);
  if (settings.filled < 1) fillFromSites(tree, length, settings.filled, draws.first_site, filled);
  return filled;
}

Eigen::VectorXd filledPoints(const VesselTree& tree, const std::vector<bool>& filled_branches) {
  Eigen::VectorXd filled = Eigen::VectorXd::Zero(tree.size());
  for (std::size_t b = 0; b < filled_branches.size(); ++b) {
    if (!filled_branches[b]) continue;
    for (const int i : tree.branches()[b]) filled[i] = 1;
  }
  return filled;
}

}  // namespace angio::simulation
