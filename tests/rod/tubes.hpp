// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <string>
#include <vector>

#include "angio/test/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::test {

/// A tree of such points [m], all of one radius.
inline VesselTree treeOf(const std::vector<Eigen::Vector3d>& points, const std::vector<int>& parents, double radius_m) {
  Eigen::Matrix3Xd matrix(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t k = 0; k < points.size(); ++k) matrix.col(static_cast<Eigen::Index>(k)) = points[k];
  return VesselTree(matrix, parents, std::vector<std::optional<double>>(points.size(), radius_m));
}

/// One vessel along a line of points that `at` gives for 0 to `length_m`, every `step_m` [m].
template <typename Line>
VesselTree tubeAlong(const Line& at, double length_m, double radius_m, double step_m = 1e-3) {
  std::vector<Eigen::Vector3d> points;
  std::vector<int> parents;
  const int steps = static_cast<int>(std::lround(length_m / step_m));
  for (int k = 0; k <= steps; ++k) {
    points.push_back(at(length_m * k / steps));
    parents.push_back(k - 1);
  }
  return treeOf(points, parents, radius_m);
}

/// From the origin along z.
inline VesselTree straightTube(double length_m, double radius_m, double step_m = 1e-3) {
  return tubeAlong([](double s) { return Eigen::Vector3d(0, 0, s); }, length_m, radius_m, step_m);
}

/// From the origin along z, `straight_m` on both sides of an arc of `radius_of_bend_m` through `angle_rad` towards x.
inline VesselTree bentTube(double straight_m, double radius_of_bend_m, double angle_rad, double radius_m) {
  const double arc_m = radius_of_bend_m * angle_rad;
  const auto at = [=](double s) {
    const double a = std::min(std::max(s - straight_m, 0.0) / radius_of_bend_m, angle_rad);
    const Eigen::Vector3d on(radius_of_bend_m * (1 - std::cos(a)), 0, straight_m + radius_of_bend_m * std::sin(a));
    if (s < straight_m) return Eigen::Vector3d(0, 0, s);
    return Eigen::Vector3d(on + std::max(s - straight_m - arc_m, 0.0) * Eigen::Vector3d(std::sin(a), 0, std::cos(a)));
  };
  return tubeAlong(at, 2 * straight_m + arc_m, radius_m);
}

/// A trunk along z that splits into two branches, `angle_rad` to +x and to -x.
inline VesselTree forkedTube(double trunk_m, double branch_m, double angle_rad, double trunk_radius_m,
                             double branch_radius_m) {
  std::vector<Eigen::Vector3d> points;
  std::vector<int> parents;
  std::vector<std::optional<double>> radii;
  const auto add = [&](int parent, const Eigen::Vector3d& p, double radius_m) {
    points.push_back(p);
    parents.push_back(parent);
    radii.emplace_back(radius_m);
    return static_cast<int>(points.size()) - 1;
  };
  int fork = -1;
  for (int k = 0; k <= std::lround(1e3 * trunk_m); ++k) fork = add(fork, {0, 0, 1e-3 * k}, trunk_radius_m);
  for (const double side : {1.0, -1.0}) {
    int end = fork;
    for (int k = 1; k <= std::lround(1e3 * branch_m); ++k) {
      end = add(end,
                points[static_cast<std::size_t>(fork)] +
                    1e-3 * k * Eigen::Vector3d(side * std::sin(angle_rad), 0, std::cos(angle_rad)),
                branch_radius_m);
    }
  }
  Eigen::Matrix3Xd matrix(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t k = 0; k < points.size(); ++k) matrix.col(static_cast<Eigen::Index>(k)) = points[k];
  return VesselTree(matrix, parents, radii);
}

/// A closed form is met within 5 %, as asked of the rod; prints by how much.
inline void expectClosedForm(const std::string& what, double value, double closed) {
  std::cout << what << ": " << value / closed << " of the closed form\n";
  EXPECT_NEAR(value, closed, 0.05 * std::abs(closed)) << what;
}

}  // namespace angio::test
