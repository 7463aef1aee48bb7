// SPDX-License-Identifier: GPL-2.0-or-later
#include "place_grid.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/vessel/resample.hpp"

namespace angio::localisation {
namespace {

struct Growing {
  std::vector<Eigen::Vector3d> points;
  PlaceGrid grid;

  int add(const Eigen::Vector3d& point, int parent, int branch, double arc_m, double path_m) {
    points.push_back(point);
    grid.parent.push_back(parent);
    grid.branch.push_back(branch);
    grid.arc_m.push_back(arc_m);
    grid.path_m.push_back(path_m);
    return static_cast<int>(points.size()) - 1;
  }
};

// Puts a branch's places into the grid, after `start`; returns the last one.
int addBranch(Growing& growing, const VesselTree& tree, int branch, int start, double spacing_m) {
  const std::vector<int>& points = tree.branches()[branch];
  const std::vector<double> arc = arcLengths(tree, points);
  const int steps = std::max(1, static_cast<int>(std::ceil(arc.back() / spacing_m - 1e-9)));
  const double path_before_m = growing.grid.path_m[start];
  std::size_t k = 0;
  int last = start;
  for (int step = 1; step <= steps; ++step) {
    const double at = arc.back() * step / steps;
    while (k + 2 < arc.size() && arc[k + 1] < at) ++k;
    const double edge = arc[k + 1] - arc[k];
    const double weight = edge > 0 ? std::clamp((at - arc[k]) / edge, 0.0, 1.0) : 1;
    const Eigen::Vector3d point =
        (1 - weight) * tree.points().col(points[k]) + weight * tree.points().col(points[k + 1]);
    last = growing.add(point, last, branch, at, path_before_m + at);
  }
  return last;
}

}  // namespace

PlaceGrid makePlaceGrid(const VesselTree& tree, double spacing_m) {
  requirePositive("catheter localiser", "spacing_m", spacing_m);
  spacing_m = std::max(spacing_m, tree.length() / kMaxPlaces);
  Growing growing;
  growing.grid.spacing_m = spacing_m;
  std::vector<int> place_of(tree.size(), -1);  // Of roots, bifurcations and leaves.
  for (std::size_t c = 0; c < tree.branches().size(); ++c) {
    const int first = tree.branches()[c].front(), last = tree.branches()[c].back();
    if (place_of[first] < 0) place_of[first] = growing.add(tree.points().col(first), -1, static_cast<int>(c), 0, 0);
    place_of[last] = addBranch(growing, tree, static_cast<int>(c), place_of[first], spacing_m);
    growing.grid.last_of_branch.push_back(place_of[last]);
  }

  PlaceGrid& grid = growing.grid;
  grid.points_m.resize(3, grid.size());
  grid.directions.resize(3, grid.size());
  grid.children.resize(grid.size());
  for (int i = 0; i < grid.size(); ++i) grid.points_m.col(i) = growing.points[i];
  for (int i = 0; i < grid.size(); ++i) {
    if (grid.parent[i] >= 0) grid.children[grid.parent[i]].push_back(i);
  }
  for (int i = 0; i < grid.size(); ++i) {
    // Backwards there is one route only, so a bifurcation points as its own branch does.
    const int from = grid.parent[i] >= 0 ? grid.parent[i] : i;
    const int to = grid.parent[i] >= 0 ? i : grid.children[i].front();
    const Eigen::Vector3d step = grid.points_m.col(to) - grid.points_m.col(from);
    grid.directions.col(i) = step.norm() > 0 ? Eigen::Vector3d(step.normalized()) : Eigen::Vector3d::UnitX();
  }
  return std::move(growing.grid);
}

int placeAt(const PlaceGrid& grid, int branch, double arc_m) {
  int best = grid.last_of_branch[branch];
  for (int i = best; i >= 0 && grid.branch[i] == branch; i = grid.parent[i]) {
    if (std::abs(grid.arc_m[i] - arc_m) < std::abs(grid.arc_m[best] - arc_m)) best = i;
  }
  return best;
}

}  // namespace angio::localisation
