// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/resample.hpp"

#include <algorithm>
#include <cmath>

namespace angio::vessel {
namespace {

// Where the new points of a branch go, by arc length: first and last are the branch's ends.
std::vector<double> subdivided(const std::vector<double>& s, double spacing_m) {
  std::vector<double> result{s.front()};
  for (std::size_t k = 1; k < s.size(); ++k) {
    const double edge = s[k] - s[k - 1];
    const int pieces = spacing_m > 0 ? std::max(1, static_cast<int>(std::ceil(edge / spacing_m - 1e-9))) : 1;
    for (int p = 1; p < pieces; ++p) result.push_back(s[k - 1] + edge * p / pieces);
    result.push_back(s[k]);
  }
  return result;
}

std::vector<double> equalSteps(const std::vector<double>& s, double step_m) {
  const int pieces = std::max(1, static_cast<int>(std::lround(s.back() / step_m)));
  std::vector<double> result(pieces + 1);
  for (int p = 0; p <= pieces; ++p) result[p] = s.back() * p / pieces;
  return result;
}

// Index k and weight w so that position `at` lies at (1-w) s[k] + w s[k+1].
std::pair<std::size_t, double> locate(const std::vector<double>& s, double at) {
  const auto above = std::upper_bound(s.begin() + 1, s.end() - 1, at);
  const std::size_t k = static_cast<std::size_t>(above - s.begin()) - 1;
  const double edge = s[k + 1] - s[k];
  return {k, edge > 0 ? std::clamp((at - s[k]) / edge, 0.0, 1.0) : 0.0};
}

}  // namespace

std::vector<double> arcLengths(const VesselTree& tree, const std::vector<int>& branch) {
  std::vector<double> s(branch.size(), 0.0);
  for (std::size_t k = 1; k < branch.size(); ++k) {
    s[k] = s[k - 1] + (tree.points().col(branch[k]) - tree.points().col(branch[k - 1])).norm();
  }
  return s;
}

Eigen::Index nearestPoint(const VesselTree& tree, const Eigen::Vector3d& place_m) {
  Eigen::Index nearest = 0;
  (tree.points().colwise() - place_m).colwise().squaredNorm().minCoeff(&nearest);
  return nearest;
}

Eigen::Matrix3Xd ResampledTree::ofOriginal(const Eigen::Matrix3Xd& of_tree) const {
  Eigen::Matrix3Xd result(3, place_of_original.size());
  for (std::size_t i = 0; i < place_of_original.size(); ++i) {
    const Place& place = place_of_original[i];
    result.col(i) = (1 - place.weight) * of_tree.col(place.a) + place.weight * of_tree.col(place.b);
  }
  return result;
}

ResampledTree resampled(const VesselTree& tree, double spacing_m, int max_points) {
  std::vector<std::vector<double>> positions, wanted;
  std::size_t count = 0;
  for (const auto& branch : tree.branches()) {
    positions.push_back(arcLengths(tree, branch));
    wanted.push_back(subdivided(positions.back(), spacing_m));
    count += wanted.back().size();
  }
  if (count > static_cast<std::size_t>(max_points)) {
    const double step_m = tree.length() / max_points;
    for (std::size_t b = 0; b < wanted.size(); ++b) wanted[b] = equalSteps(positions[b], step_m);
  }

  std::vector<Eigen::Vector3d> points;
  std::vector<int> parents;
  std::vector<std::optional<double>> radii;
  std::vector<int> index_of_end(tree.size(), -1);  // New index of roots, bifurcations and leaves.
  std::vector<ResampledTree::Place> place(tree.size());
  const auto add = [&](const Eigen::Vector3d& p, int parent, std::optional<double> radius) {
    points.push_back(p);
    parents.push_back(parent);
    radii.push_back(radius);
    return static_cast<int>(points.size()) - 1;
  };

  for (int i = 0; i < tree.size(); ++i) {
    if (tree.parents()[i] >= 0) continue;
    const int root = index_of_end[i] = add(tree.points().col(i), -1, tree.radii()[i]);
    place[i] = {root, root, 0};
  }
  for (std::size_t b = 0; b < wanted.size(); ++b) {
    const auto& branch = tree.branches()[b];
    const auto& s = positions[b];
    std::vector<int> index{index_of_end[branch.front()]};
    for (std::size_t k = 1; k < wanted[b].size(); ++k) {
      const auto [at, w] = locate(s, wanted[b][k]);
      const Eigen::Vector3d p = (1 - w) * tree.points().col(branch[at]) + w * tree.points().col(branch[at + 1]);
      const auto &r0 = tree.radii()[branch[at]], &r1 = tree.radii()[branch[at + 1]];
      index.push_back(add(p, index.back(), r0 && r1 ? std::optional((1 - w) * *r0 + w * *r1) : w < 0.5 ? r0 : r1));
    }
    index_of_end[branch.back()] = index.back();
    for (std::size_t k = 1; k < branch.size(); ++k) {
      const auto [at, w] = locate(wanted[b], s[k]);
      place[branch[k]] = {index[at], index[at + 1], w};
    }
  }

  Eigen::Matrix3Xd matrix(3, points.size());
  for (std::size_t i = 0; i < points.size(); ++i) matrix.col(i) = points[i];
  return {VesselTree(std::move(matrix), std::move(parents), std::move(radii)), std::move(place)};
}

}  // namespace angio::vessel
