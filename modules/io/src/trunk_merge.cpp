// SPDX-License-Identifier: GPL-2.0-or-later
#include "trunk_merge.hpp"

#include <algorithm>

namespace angio::io {
namespace {

constexpr double kToleranceOfRadius = 0.1;
constexpr double kMinTolerance = 0.1;  // Well below a pixel of any X-ray system [mm].
// A step along a line passes a few edges of the tree; this many only in a file made to waste time.
constexpr int kMaxEdges = 256;

}  // namespace

double TrunkMerge::tolerance(int i) const {
  const auto& radius_mm = rows_[i].radius_mm;
  return std::max(kMinTolerance, radius_mm ? kToleranceOfRadius * *radius_mm : 0.0);
}

std::optional<TrunkMerge::Place> TrunkMerge::startAt(const Eigen::Vector3d& point_mm) const {
  for (const int root : roots_) {
    const double distance = (rows_[root].point_mm - point_mm).norm();
    if (distance <= tolerance(root)) return Place{root, root};
  }
  const auto same = point_at_.find(positionOf(point_mm));
  if (same != point_at_.end()) return Place{same->second, same->second};
  return std::nullopt;
}

std::optional<TrunkMerge::Place> TrunkMerge::follow(int from, const Eigen::Vector3d& point_mm, double step_mm) const {
  const auto at = [&](int i) -> const Eigen::Vector3d& { return rows_[i].point_mm; };
  Place best{from, from};
  double best_distance = (at(from) - point_mm).norm();
  double best_tolerance = tolerance(from);
  int edges = 0;
  std::vector<std::pair<int, double>> open{{from, 0.0}};  // A point and how far down the tree it is [mm].
  for (std::size_t visited = 0; visited < open.size(); ++visited) {
    const auto [a, depth_mm] = open[visited];
    for (const int b : children_[a]) {
      if (++edges > kMaxEdges) break;
      const Eigen::Vector3d edge = at(b) - at(a);
      const double t = std::clamp(edge.dot(point_mm - at(a)) / edge.squaredNorm(), 0.0, 1.0);
      const double distance = (at(a) + t * edge - point_mm).norm();
      if (distance < best_distance) {
        best = {t < 1 ? a : b, t > 0.5 ? b : a};
        best_distance = distance;
        best_tolerance = tolerance(b);
      }
      const double next_depth_mm = depth_mm + edge.norm();
      if (next_depth_mm <= 2 * step_mm + tolerance(b)) open.emplace_back(b, next_depth_mm);
    }
  }
  if (best_distance > best_tolerance) return std::nullopt;
  return best;
}

void TrunkMerge::append(int parent, const Eigen::Vector3d& point_mm, std::optional<double> radius_mm) {
  const int id = static_cast<int>(rows_.size());
  rows_.push_back({0, id, point_mm, radius_mm, parent});
  children_.emplace_back();
  point_at_.emplace(positionOf(point_mm), id);
  (parent < 0 ? roots_ : children_[parent]).push_back(id);
}

void TrunkMerge::addLine(const std::vector<Eigen::Vector3d>& points_mm,
                         const std::vector<std::optional<double>>& radii_mm) {
  if (points_mm.empty()) return;
  std::size_t k = 1;
  auto position = startAt(points_mm[0]);
  if (!position) {
    append(-1, points_mm[0], radii_mm[0]);
    position = Place{rows_.back().id, rows_.back().id};
  } else {
    for (; k < points_mm.size(); ++k) {
      const auto next = follow(position->from, points_mm[k], (points_mm[k] - points_mm[k - 1]).norm());
      if (!next) break;
      position = next;
    }
  }
  int parent = position->nearest;
  for (; k < points_mm.size(); ++k) {
    if (points_mm[k] == rows_[parent].point_mm) continue;  // No edge without a length.
    append(parent, points_mm[k], radii_mm[k]);
    parent = rows_.back().id;
  }
}

}  // namespace angio::io
