// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/tree_topology.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace angio::vessel {
namespace {

// Centrelines zigzag from point to point; over this length to either side they do what the vessel does.
constexpr double kChord_m = 2e-3;
constexpr double kUnknownRadius_m = 1e-3;
constexpr double kPartingStep_m = 0.5e-3, kMaxParting_m = 12e-3;

struct Spot {
  std::size_t below = 0;
  double weight = 0;
};

Spot spotAt(const std::vector<double>& arc_m, double s) {
  const double clamped = std::clamp(s, 0.0, arc_m.back());
  const auto above = std::upper_bound(arc_m.begin() + 1, arc_m.end() - 1, clamped);
  const auto k = static_cast<std::size_t>(above - arc_m.begin());
  const double gap = arc_m[k] - arc_m[k - 1];
  return {k - 1, gap > 0 ? (clamped - arc_m[k - 1]) / gap : 0.0};
}

template <typename T>
T between(const std::vector<T>& values, const Spot& at) {
  return (1 - at.weight) * values[at.below] + at.weight * values[at.below + 1];
}

// The part of `v` across `along`, of length 1; any such direction where there is none.
Eigen::Vector3d squared(const Eigen::Vector3d& v, const Eigen::Vector3d& along) {
  const Eigen::Vector3d rest = v - v.dot(along) * along;
  return rest.norm() > 1e-9 ? Eigen::Vector3d(rest.normalized()) : along.unitOrthogonal();
}

double angleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

TreeTopology::TreeTopology(const VesselTree& tree) : lines_(tree.branches().size()) {
  std::vector<int> ending(tree.size(), -1);  // The branch that ends at a point.
  for (int c = 0; c < branchCount(); ++c) {
    Line& line = lines_[c];
    line.points = tree.branches()[c];
    ending[line.points.back()] = c;
    for (const int i : line.points) {
      const Eigen::Vector3d p = tree.points().col(i);
      line.arc_m.push_back(line.place.empty() ? 0.0 : line.arc_m.back() + (p - line.place.back()).norm());
      line.place.push_back(p);
      line.radius_m.push_back(tree.radii()[i].value_or(kUnknownRadius_m));
    }
  }
  for (int c = 0; c < branchCount(); ++c) {
    const int before = ending[lines_[c].points.front()];
    if (before < 0) continue;
    lines_[c].parent = before;
    lines_[before].children.push_back(c);
  }
  std::vector<int> open;
  for (int c = branchCount() - 1; c >= 0; --c) {
    if (!lines_[c].parent) open.push_back(c);
  }
  while (!open.empty()) {
    const int c = open.back();
    open.pop_back();
    layFrames(c);
    for (const int child : lines_[c].children) {
      lines_[child].start_m = lines_[c].start_m + length_m(c);
      open.push_back(child);
    }
  }
  for (int c = 0; c < branchCount(); ++c) lines_[c].parting_m = findParting(c);
}

TreeLocation TreeTopology::before(const TreeLocation& place, double back_m) const {
  TreeLocation at{place.branch, std::min(place.arc_m, length_m(place.branch)) - back_m};
  while (at.arc_m < 0 && lines_[at.branch].parent) {
    at.branch = *lines_[at.branch].parent;
    at.arc_m += lines_[at.branch].arc_m.back();
  }
  at.arc_m = std::max(at.arc_m, 0.0);
  return at;
}

void TreeTopology::layFrames(int branch) {
  Line& line = lines_[branch];
  Eigen::Vector3d last_along, last_normal;
  double turned = 0;
  if (line.parent) {
    const Line& before = lines_[*line.parent];
    last_along = before.along.back();
    last_normal = before.normal.back();
    turned = before.turned_rad.back();
  }
  for (std::size_t k = 0; k < line.points.size(); ++k) {
    const Eigen::Vector3d ahead = point({branch, line.arc_m[k] + kChord_m});
    const Eigen::Vector3d chord = ahead - point(before({branch, line.arc_m[k]}, kChord_m));
    Eigen::Vector3d along = Eigen::Vector3d::UnitZ();
    if (chord.norm() > 0) {
      along = chord.normalized();
    } else if (k > 0 || line.parent) {
      along = last_along;
    }
    if (k == 0 && !line.parent) {
      last_along = along;
      last_normal = along.unitOrthogonal();
    }
    turned += angleBetween(last_along, along);
    // Carried by the smallest rotation that brings one tangent to the next: no twist.
    last_normal = squared(Eigen::Quaterniond::FromTwoVectors(last_along, along) * last_normal, along);
    last_along = along;
    line.along.push_back(along);
    line.normal.push_back(last_normal);
    line.turned_rad.push_back(turned);
  }
}

std::vector<int> TreeTopology::pathTo(int branch) const {
  std::vector<int> path{branch};
  while (lines_.at(path.back()).parent) path.push_back(*lines_[path.back()].parent);
  std::reverse(path.begin(), path.end());
  return path;
}

std::vector<int> TreeTopology::pointsTo(const TreeLocation& place) const {
  std::vector<int> result;
  for (const int branch : pathTo(place.branch)) {
    const Line& line = lines_[branch];
    for (std::size_t k = 0; k < line.points.size(); ++k) {
      if (branch == place.branch && line.arc_m[k] > place.arc_m) break;
      if (result.empty() || result.back() != line.points[k]) result.push_back(line.points[k]);
    }
  }
  return result;
}

bool TreeTopology::passes(int branch, int other) const {
  std::optional<int> at = branch;
  while (at && *at != other) at = lines_.at(*at).parent;
  return at.has_value();
}

EdgePoint TreeTopology::spot(const TreeLocation& place) const {
  const Line& line = lines_.at(place.branch);
  const Spot at = spotAt(line.arc_m, place.arc_m);
  return {line.points[at.below], line.points[at.below + 1], at.weight};
}

Eigen::Vector3d TreeTopology::point(const TreeLocation& place) const {
  const Line& line = lines_.at(place.branch);
  return between(line.place, spotAt(line.arc_m, place.arc_m));
}

TreeFrame TreeTopology::frame(const TreeLocation& place) const {
  const Line& line = lines_.at(place.branch);
  const Spot at = spotAt(line.arc_m, place.arc_m);
  TreeFrame frame;
  const Eigen::Vector3d along = between(line.along, at);
  frame.along = along.norm() > 1e-6 ? Eigen::Vector3d(along.normalized()) : line.along[at.below];
  frame.normal = squared(between(line.normal, at), frame.along);
  frame.binormal = frame.along.cross(frame.normal);
  return frame;
}

double TreeTopology::turned_rad(const TreeLocation& place) const {
  const Line& line = lines_.at(place.branch);
  return between(line.turned_rad, spotAt(line.arc_m, place.arc_m));
}

double TreeTopology::radius_m(const TreeLocation& place) const {
  const Line& line = lines_.at(place.branch);
  return between(line.radius_m, spotAt(line.arc_m, place.arc_m));
}

std::vector<TreeRoute> TreeTopology::routesFrom(int branch, double length_m) const {
  std::vector<TreeRoute> routes;
  const Eigen::Vector3d from = lines_.at(branch).place.back();
  for (const int child : lines_[branch].children) addRoutes(child, child, length_m, from, routes);
  return routes;
}

void TreeTopology::addRoutes(int child, int branch, double left_m, const Eigen::Vector3d& from,
                             std::vector<TreeRoute>& routes) const {
  const Line& line = lines_[branch];
  if (left_m > length_m(branch) && !line.children.empty()) {
    for (const int next : line.children) addRoutes(child, next, left_m - length_m(branch), from, routes);
    return;
  }
  const TreeLocation end{branch, left_m};
  const Eigen::Vector3d chord = point(end) - from;
  routes.push_back(
      {child, branch, radius_m(end), chord.norm() > 0 ? Eigen::Vector3d(chord.normalized()) : frame({child, 0}).along});
}

double TreeTopology::findParting(int branch) const {
  const std::vector<TreeRoute> routes = routesFrom(branch, kMaxParting_m);
  const double fork_m = start_m(branch) + length_m(branch);
  const auto along = [&](const TreeRoute& route, double s) {
    int at = route.last;
    while (at != route.child && start_m(at) > fork_m + s) at = *lines_[at].parent;
    return TreeLocation{at, fork_m + s - start_m(at)};
  };
  const auto length = [&](const TreeRoute& route) { return start_m(route.last) + length_m(route.last) - fork_m; };
  double parted_m = 0;
  for (std::size_t a = 0; a < routes.size(); ++a) {
    for (std::size_t b = a + 1; b < routes.size(); ++b) {
      if (routes[a].child == routes[b].child) continue;
      const double shorter_m = std::min({kMaxParting_m, length(routes[a]), length(routes[b])});
      double s = 0;
      for (; s < shorter_m; s += kPartingStep_m) {
        const TreeLocation p = along(routes[a], s), q = along(routes[b], s);
        if ((point(p) - point(q)).norm() > std::max(radius_m(p), radius_m(q))) break;
      }
      parted_m = std::max(parted_m, std::min(s, shorter_m));
    }
  }
  return parted_m;
}

}  // namespace angio::vessel
