// SPDX-License-Identifier: GPL-2.0-or-later
// A belief in words that a navigator reads: chains, arc lengths and how sure.
#include <algorithm>
#include <cmath>

#include "tip_filter.hpp"

namespace angio::localisation {
namespace {

constexpr double kWorthNaming = 0.01;

// The first moments of the places of one chain.
struct ChainMoments {
  double mass = 0, arc_m = 0, arc_squared = 0;
};

// The place at an arc length, between the grid's.
TipPlace placeOf(const PlaceGrid& grid, int chain, const ChainMoments& moments) {
  TipPlace place;
  place.chain = chain;
  place.probability = std::min(moments.mass, 1.0);  // A sum of many may round to more.
  place.arc_m = moments.arc_m / moments.mass;
  const double variance = std::max(0.0, moments.arc_squared / moments.mass - place.arc_m * place.arc_m);
  place.std_m = std::sqrt(variance + grid.spacing_m * grid.spacing_m / 12);
  int above = grid.last_of_chain[chain];
  place.path_m = grid.path_m[above] - grid.arc_m[above] + place.arc_m;
  while (grid.parent[above] >= 0 && grid.path_m[grid.parent[above]] >= place.path_m) above = grid.parent[above];
  const int below = grid.parent[above];
  place.direction_model = grid.directions.col(above);
  place.tip_model = grid.points_m.col(above);
  if (below >= 0 && grid.path_m[above] > grid.path_m[below]) {
    const double weight = (place.path_m - grid.path_m[below]) / (grid.path_m[above] - grid.path_m[below]);
    place.tip_model = (1 - weight) * grid.points_m.col(below) + weight * grid.points_m.col(above);
  }
  return place;
}

}  // namespace

TipBelief TipFilter::summarised(const std::vector<double>& probability) const {
  std::vector<ChainMoments> moments(grid_.last_of_chain.size());
  for (int i = 0; i < grid_.size(); ++i) {
    ChainMoments& chain = moments[grid_.chain[i]];
    chain.mass += probability[i];
    chain.arc_m += probability[i] * grid_.arc_m[i];
    chain.arc_squared += probability[i] * grid_.arc_m[i] * grid_.arc_m[i];
  }
  std::vector<int> order(moments.size());
  for (std::size_t c = 0; c < order.size(); ++c) order[c] = static_cast<int>(c);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return moments[a].mass > moments[b].mass; });
  TipBelief belief;
  belief.tip = placeOf(grid_, order.front(), moments[order.front()]);
  for (std::size_t k = 1; k < order.size() && moments[order[k]].mass > kWorthNaming; ++k) {
    belief.alternatives.push_back(placeOf(grid_, order[k], moments[order[k]]));
  }
  for (int i = 0; i < grid_.size(); ++i) {
    const bool near =
        (grid_.points_m.col(i) - belief.tip.tip_model).squaredNorm() <= std::pow(1e-3 * settings_.near_mm, 2);
    if (near) belief.near_probability += probability[i];
  }
  belief.near_probability = std::min(belief.near_probability, 1.0);
  return belief;
}

}  // namespace angio::localisation
