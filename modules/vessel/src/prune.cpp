// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/prune.hpp"

#include <algorithm>
#include <utility>

#include "angio/base/errors.hpp"

namespace angio::vessel {
namespace {

std::vector<std::vector<int>> neighboursOf(const VesselTree& tree) {
  std::vector<std::vector<int>> neighbours = tree.children();
  for (int i = 0; i < tree.size(); ++i) {
    const int parent = tree.parents()[i];
    if (parent >= 0) neighbours[i].push_back(parent);
  }
  return neighbours;
}

// The points that are reached from `cut` through its neighbour `first`, each with the index of the one before it.
std::vector<std::pair<int, int>> piece(const std::vector<std::vector<int>>& neighbours, int cut, int first) {
  std::vector<std::pair<int, int>> points{{cut, -1}, {first, 0}};
  for (std::size_t k = 1; k < points.size(); ++k) {
    const int before = points[points[k].second].first;
    for (const int next : neighbours[points[k].first]) {
      if (next != before) points.emplace_back(next, static_cast<int>(k));
    }
  }
  return points;
}

}  // namespace

VesselTree withoutLongEdges(const VesselTree& tree, double max_m) {
  requirePositive("vessel tree", "max_edge_mm", max_m * 1e3);
  std::vector<int> parents = tree.parents();
  for (int i = 0; i < tree.size(); ++i) {
    int& parent = parents[i];
    if (parent >= 0 && (tree.points().col(i) - tree.points().col(parent)).norm() > max_m) parent = -1;
  }
  if (std::all_of(parents.begin(), parents.end(), [](int parent) { return parent < 0; })) {
    throw InputError("vessel tree", "max_edge_mm", formatValue(max_m * 1e3), "every edge is longer");
  }
  return VesselTree(tree.points(), std::move(parents), tree.radii());
}

VesselTree beginningAt(const VesselTree& tree, const Eigen::Vector3d& place_m) {
  if (!place_m.allFinite()) throw InputError("vessel tree", "root", "", "must be finite");
  const auto neighbours = neighboursOf(tree);
  int cut = -1;
  double nearest = 0;
  for (int i = 0; i < tree.size(); ++i) {
    const double off = (tree.points().col(i) - place_m).squaredNorm();
    if (neighbours[i].empty() || (cut >= 0 && off >= nearest)) continue;
    cut = i;
    nearest = off;
  }
  std::vector<std::pair<int, int>> longest;
  double max_m = -1;
  for (const int first : neighbours[cut]) {
    auto points = piece(neighbours, cut, first);
    double length_m = 0;
    for (std::size_t k = 1; k < points.size(); ++k) {
      const int before = points[points[k].second].first;
      length_m += (tree.points().col(points[k].first) - tree.points().col(before)).norm();
    }
    if (length_m > max_m) max_m = length_m, longest = std::move(points);
  }
  Eigen::Matrix3Xd points_m(3, longest.size());
  std::vector<int> parents;
  std::vector<std::optional<double>> radii_m;
  for (const auto& [point, before] : longest) {
    points_m.col(parents.size()) = tree.points().col(point);
    parents.push_back(before);
    radii_m.push_back(tree.radii()[point]);
  }
  return VesselTree(std::move(points_m), std::move(parents), std::move(radii_m));
}

}  // namespace angio::vessel
