// SPDX-License-Identifier: GPL-2.0-or-later
#include "place_field.hpp"

#include <cmath>

namespace angio::localisation {

PlaceField::PlaceField(const PlaceGrid& grid, const std::vector<int>& tips, double step_m)
    : grid_(grid), node_below_(grid.size(), -1) {
  std::vector<int> ways(grid.size(), 0);  // How many used children a place has, plus one for being used.
  for (const int tip : tips) {
    if (ways[tip] == 0) ways[tip] = 1;
    for (int at = tip; grid.parent[at] >= 0; at = grid.parent[at]) {
      const bool known = ways[grid.parent[at]] > 0 && node_below_[at] == -2;
      if (known) break;
      node_below_[at] = -2;  // The edge above has been counted.
      ways[grid.parent[at]] += ways[grid.parent[at]] == 0 ? 2 : 1;
    }
  }
  // Parents first: nodes at roots, forks, ends, and where the last one is a step away.
  std::vector<int> node_above(grid.size(), -1);
  for (int i = 0; i < grid.size(); ++i) {
    node_below_[i] = -1;
    if (ways[i] == 0) continue;
    const int above = grid.parent[i] >= 0 ? node_above[grid.parent[i]] : -1;
    const bool far = above < 0 || grid.path_m[i] - grid.path_m[nodes_[above].place] >= step_m;
    node_above[i] = above;
    if (!far && ways[i] == 2) continue;
    node_above[i] = static_cast<int>(nodes_.size());
    nodes_.push_back({i, above});
  }
  for (int i = grid.size() - 1; i >= 0; --i) {
    if (ways[i] == 0) continue;
    if (nodes_[node_above[i]].place == i) node_below_[i] = node_above[i];
    const int parent = grid.parent[i];
    if (parent >= 0 && nodes_[node_above[parent]].place != parent) node_below_[parent] = node_below_[i];
  }
}

std::optional<PlaceField::Between> PlaceField::at(int place) const {
  const int below = node_below_[place];
  if (below < 0) return std::nullopt;
  const int above = nodes_[below].parent;
  if (above < 0) return Between{below, below, 0};
  const double from = grid_.path_m[nodes_[above].place], to = grid_.path_m[nodes_[below].place];
  return Between{above, below, to > from ? (grid_.path_m[place] - from) / (to - from) : 1};
}

Eigen::Matrix3Xd PlaceField::spread(const Eigen::Matrix3Xd& of_nodes_m, double length_m) const {
  Eigen::Matrix3Xd result = Eigen::Matrix3Xd::Zero(3, grid_.size());
  for (int i = 0; i < grid_.size(); ++i) {
    const int parent = grid_.parent[i];
    if (const auto between = at(i)) {
      result.col(i) = (1 - between->weight) * of_nodes_m.col(between->a) + between->weight * of_nodes_m.col(between->b);
    } else if (parent >= 0) {
      result.col(i) = std::exp((grid_.path_m[parent] - grid_.path_m[i]) / length_m) * result.col(parent);
    }
  }
  return result;
}

}  // namespace angio::localisation
