// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/vessel_tree.hpp"

#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/base/fnv1a.hpp"
#include "angio/vessel/model_id.hpp"

namespace angio::vessel {
namespace {

// A coordinate beyond this is a unit mistake: no patient is ten metres long.
constexpr double kMaxCoordinate = 10.0;

// The first point that no root is reached from, or -1.
int findLoop(const std::vector<int>& parents) {
  enum : char { kNew, kOnPath, kSound };
  std::vector<char> state(parents.size(), kNew);
  std::vector<int> path;
  for (int start = 0; start < static_cast<int>(parents.size()); ++start) {
    path.clear();
    int i = start;
    while (i >= 0 && state[i] == kNew) {
      state[i] = kOnPath;
      path.push_back(i);
      i = parents[i];
    }
    if (i >= 0 && state[i] == kOnPath) return i;
    for (const int done : path) state[done] = kSound;
  }
  return -1;
}

}  // namespace

std::optional<TreeDefect> VesselTree::findDefect(const Eigen::Matrix3Xd& points_m, const std::vector<int>& parents,
                                                 const std::vector<std::optional<double>>& radii_m) {
  const int n = static_cast<int>(parents.size());
  if (points_m.cols() != n || static_cast<int>(radii_m.size()) != n) {
    return TreeDefect{0, "size", std::to_string(points_m.cols()), "points, parents and radii must be as many"};
  }
  static const char* const kAxis[3] = {"x_mm", "y_mm", "z_mm"};
  bool has_edge = false;
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) {
      const double x = points_m(k, i);
      if (!std::isfinite(x)) return TreeDefect{i, kAxis[k], formatValue(x), "must be a finite number"};
      if (std::abs(x) > kMaxCoordinate)
        return TreeDefect{i, kAxis[k], formatValue(x * 1e3), "must lie within 10,000 mm"};
    }
    if (radii_m[i] && !(std::isfinite(*radii_m[i]) && *radii_m[i] > 0 && *radii_m[i] < 1)) {
      return TreeDefect{i, "radius_mm", formatValue(*radii_m[i] * 1e3),
                        "must be positive and below 1,000 mm, or blank"};
    }
    if (parents[i] < -1 || parents[i] >= n) {
      return TreeDefect{i, "parent", std::to_string(parents[i]), "must be a point of the tree, or -1 at a root"};
    }
    if (parents[i] == i) return TreeDefect{i, "parent", std::to_string(i), "a point must not be its own parent"};
    has_edge = has_edge || parents[i] >= 0;
  }
  if (n < 2) return TreeDefect{0, "points", std::to_string(n), "a tree needs at least two points"};
  if (!has_edge) return TreeDefect{0, "parent", "-1", "at least one point must have a parent"};
  const int in_loop = findLoop(parents);
  if (in_loop >= 0) {
    return TreeDefect{in_loop, "parent", std::to_string(parents[in_loop]), "the tree must not have a loop"};
  }
  return std::nullopt;
}

VesselTree::VesselTree(Eigen::Matrix3Xd points_m, std::vector<int> parents, std::vector<std::optional<double>> radii_m)
    : points_(std::move(points_m)), parents_(std::move(parents)), radii_(std::move(radii_m)) {
  if (radii_.empty()) radii_.resize(parents_.size());
  if (const auto defect = findDefect(points_, parents_, radii_)) {
    throw InputError("vessel tree, point " + std::to_string(defect->point), defect->field, defect->value, defect->rule);
  }
  children_.resize(parents_.size());
  for (int i = 0; i < size(); ++i) {
    if (parents_[i] < 0) continue;
    children_[parents_[i]].push_back(i);
    length_ += (points_.col(i) - points_.col(parents_[i])).norm();
  }
  centroid_ = points_.rowwise().mean();

  // Depth first, so that neighbouring branches stand near each other.
  std::vector<std::pair<int, int>> open;  // Start of a branch and its second point.
  for (int i = size() - 1; i >= 0; --i) {
    if (parents_[i] >= 0) continue;
    for (const int child : children_[i]) open.emplace_back(i, child);
  }
  while (!open.empty()) {
    auto [start, next] = open.back();
    open.pop_back();
    std::vector<int> branch{start, next};
    while (children_[branch.back()].size() == 1) branch.push_back(children_[branch.back()].front());
    for (const int child : children_[branch.back()]) open.emplace_back(branch.back(), child);
    branches_.push_back(std::move(branch));
  }
}

std::vector<int> VesselTree::parentsFirst() const {
  std::vector<int> order;
  for (int i = 0; i < size(); ++i) {
    if (parents_[i] < 0) order.push_back(i);
  }
  for (std::size_t k = 0; k < order.size(); ++k) {
    const std::vector<int>& next = children_[order[k]];
    order.insert(order.end(), next.begin(), next.end());
  }
  return order;
}

Eigen::Matrix3Xd VesselTree::tangents() const {
  Eigen::Matrix3Xd result(3, size());
  for (int i = 0; i < size(); ++i) {
    const Eigen::Vector3d here = points_.col(i);
    Eigen::Vector3d in = Eigen::Vector3d::Zero(), out = Eigen::Vector3d::Zero();
    if (parents_[i] >= 0) in = here - points_.col(parents_[i]);
    double straightest = -2;
    for (const int child : children_[i]) {
      const Eigen::Vector3d step = points_.col(child) - here;
      const double cosine = step.normalized().dot(in.normalized());
      if (cosine > straightest) straightest = cosine, out = step;
    }
    const Eigen::Vector3d chord = in + out;
    result.col(i) = chord.norm() > 0 ? chord.normalized() : Eigen::Vector3d::UnitX();
  }
  return result;
}

constexpr double kPerMetre = 1e9;

ModelId modelId(const VesselTree& tree) {
  Fnv1a hash;
  for (int i = 0; i < tree.size(); ++i) {
    for (const double x : tree.points().col(i)) hash.add(std::int64_t{std::llround(kPerMetre * x)});
    hash.add(std::int64_t{tree.parents()[i]});
  }
  const auto id = static_cast<std::int64_t>(hash.value());
  return static_cast<ModelId>(id == 0 ? 1 : id);
}

}  // namespace angio::vessel
