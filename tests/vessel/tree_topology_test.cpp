// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/tree_topology.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "angio/geometry/se3.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/tree_distance.hpp"

namespace angio::test {
namespace {

constexpr double kRounding = 1e-12;

// The edges that lead to one of both alone, point by point.
TEST(TreeTopology, DistancesAreThoseOfTheEdgesBetween) {
  const VesselTree tree = test::branchingTree(2);
  const TreeTopology map(tree);
  for (int a = 0; a < map.branchCount(); ++a) {
    for (int b = 0; b < map.branchCount(); ++b) {
      const TreeLocation end_a{a, map.length_m(a)}, end_b{b, map.length_m(b)};
      const std::vector<int> to_a = map.pointsTo(end_a), to_b = map.pointsTo(end_b);
      const auto edges_m = [&](const std::vector<int>& route, std::size_t from) {
        double sum_m = 0;
        for (std::size_t k = from; k < route.size(); ++k) {
          sum_m += (tree.points().col(route[k]) - tree.points().col(route[k - 1])).norm();
        }
        return sum_m;
      };
      std::size_t shared = 0;
      while (shared < std::min(to_a.size(), to_b.size()) && to_a[shared] == to_b[shared]) ++shared;
      ASSERT_GT(shared, 0U);
      EXPECT_NEAR(alongVessels_m(map, end_a, end_b), edges_m(to_a, shared) + edges_m(to_b, shared), kRounding);
      EXPECT_NEAR(*sharedRoute_m(map, end_a, end_b),
                  edges_m({to_a.begin(), to_a.begin() + static_cast<std::ptrdiff_t>(shared)}, 1), kRounding);
    }
  }
  // Within a branch, and from a root of its own.
  EXPECT_NEAR(alongVessels_m(map, {0, 1e-3}, {0, 4e-3}), 3e-3, kRounding);
  Eigen::Matrix3Xd apart(3, 4);
  apart << 0, 0, 0.3, 0.3, 0, 0, 0.4, 0.4, 0, 0.01, 0, 0.01;
  const TreeTopology two(VesselTree(apart, {-1, 0, -1, 2}, {1e-3, 1e-3, 1e-3, 1e-3}));
  EXPECT_FALSE(sharedRoute_m(two, {0, 0}, {1, 0}));
  EXPECT_NEAR(alongVessels_m(two, {0, 0}, {1, 0}), 0.5, kRounding);
}

TEST(TreeTopology, PathsLengthsAndPlacesAreTheTrees) {
  const VesselTree tree = test::branchingTree(1);
  const TreeTopology map(tree);
  ASSERT_EQ(map.branchCount(), static_cast<int>(tree.branches().size()));
  double sum = 0;
  for (int c = 0; c < map.branchCount(); ++c) {
    sum += map.length_m(c);
    const std::vector<int> path = map.pathTo(c);
    double before = 0;
    for (std::size_t k = 0; k + 1 < path.size(); ++k) {
      before += map.length_m(path[k]);
      EXPECT_EQ(tree.branches()[path[k]].back(), tree.branches()[path[k + 1]].front());
      EXPECT_TRUE(map.passes(c, path[k]));
      EXPECT_FALSE(map.passes(path[k], c));
    }
    EXPECT_NEAR(map.start_m(c), before, kRounding);
    EXPECT_EQ(map.point({c, 0}), Eigen::Vector3d(tree.points().col(tree.branches()[c].front())));
    EXPECT_EQ(map.point({c, 1e9}), Eigen::Vector3d(tree.points().col(tree.branches()[c].back())));
    const std::vector<int> to_end = map.pointsTo({c, map.length_m(c)}), to_start = map.pointsTo({c, 0});
    EXPECT_EQ(to_end.back(), tree.branches()[c].back());
    EXPECT_EQ(to_start.back(), tree.branches()[c].front());
    EXPECT_EQ(tree.parents()[to_end.front()], -1);
    for (std::size_t k = 1; k < to_end.size(); ++k) EXPECT_EQ(tree.parents()[to_end[k]], to_end[k - 1]);
    const EdgePoint spot = map.spot({c, 0.4 * map.length_m(c)});
    const Eigen::Vector3d p = (1 - spot.weight) * tree.points().col(spot.a) + spot.weight * tree.points().col(spot.b);
    EXPECT_LT((p - map.point({c, 0.4 * map.length_m(c)})).norm(), kRounding);
  }
  EXPECT_NEAR(sum, tree.length(), 1e-9);
  EXPECT_THROW(static_cast<void>(map.point({map.branchCount(), 0})), std::out_of_range);
}

// A trunk along z and two branches whose lines are one and the same for the first 4 mm; then one goes straight on, the
// other to +x. The first ends there: what goes straight on is a child of its own, as in trees that were thinned.
TEST(TreeTopology, WaysPartWhereTheyLeaveEachOthersLumens) {
  std::vector<Eigen::Vector3d> points;
  std::vector<int> parents;
  const auto add = [&](int parent, double x_mm, double z_mm) {
    points.emplace_back(1e-3 * x_mm, 0, 1e-3 * z_mm);
    parents.push_back(parent);
    return static_cast<int>(points.size()) - 1;
  };
  int trunk = add(-1, 0, 0);
  for (int k = 1; k <= 30; ++k) trunk = add(trunk, 0, k);
  int beside = trunk, ahead = trunk;
  for (int k = 1; k <= 4; ++k) beside = add(beside, 0, 30 + k), ahead = add(ahead, 0, 30 + k);
  const int second = ahead;
  for (int k = 1; k <= 20; ++k) beside = add(beside, k, 34);
  for (int k = 1; k <= 20; ++k) ahead = add(ahead, 0, 34 + k);
  int aside = second;
  for (int k = 1; k <= 20; ++k) aside = add(aside, -k, 34);
  Eigen::Matrix3Xd matrix(3, points.size());
  for (std::size_t i = 0; i < points.size(); ++i) matrix.col(static_cast<Eigen::Index>(i)) = points[i];
  const TreeTopology map(VesselTree(matrix, parents, std::vector<std::optional<double>>(points.size(), 1.5e-3)));
  ASSERT_EQ(map.children(0).size(), 2u);

  // 4 mm together, then apart by the square root of 2 for each step: 1.5 mm after 1.5 mm at most.
  EXPECT_NEAR(map.parting_m(0), 5.5e-3, 1e-3);
  EXPECT_EQ(map.parting_m(0, 3e-3), 3e-3);
  EXPECT_EQ(map.parting_m(map.children(0).front()) > 0, !map.children(map.children(0).front()).empty());

  const std::vector<TreeRoute> together = map.routesFrom(0, 4e-3), parted = map.routesFrom(0, 14e-3);
  ASSERT_EQ(together.size(), 2u);
  EXPECT_LT((together[0].direction - together[1].direction).norm(), kRounding);
  ASSERT_EQ(parted.size(), 3u);
  int straight = 0;
  for (const TreeRoute& route : parted) {
    EXPECT_TRUE(map.passes(route.last, route.child));
    EXPECT_EQ(*map.parent(route.child), 0);
    EXPECT_NEAR(route.radius_m, 1.5e-3, kRounding);
    straight += route.direction.z() > 0.999;
    EXPECT_TRUE(route.direction.z() > 0.999 || std::abs(std::abs(route.direction.x()) - 10 / std::hypot(10, 4)) < 1e-9);
  }
  EXPECT_EQ(straight, 1);
}

TEST(TreeTopology, FramesAreRightHandedAlongTheVesselAndGoOnIntoTheChildren) {
  const TreeTopology map(test::branchingTree(2));
  for (int c = 0; c < map.branchCount(); ++c) {
    for (double s = 0; s < map.length_m(c); s += 1.7e-3) {
      const TreeFrame f = map.frame({c, s});
      EXPECT_NEAR(f.along.norm(), 1, 1e-9);
      EXPECT_LT((f.along.cross(f.normal) - f.binormal).norm(), 1e-9);
    }
  }
}

// A helix has no straight piece: carried frames turn about it by its torsion, and nothing else turns them.
TEST(TreeTopology, FramesTurnAgainstAHelixByItsTorsion) {
  const double a = 0.02, b = 0.01, speed = std::hypot(a, b);
  const int n = 2001;
  Eigen::Matrix3Xd points(3, n);
  std::vector<int> parents(n);
  for (int i = 0; i < n; ++i) {
    const double t = 4.0 * i / (n - 1);
    points.col(i) << a * std::cos(t), a * std::sin(t), b * t;
    parents[i] = i - 1;
  }
  const TreeTopology map(VesselTree(points, parents));
  const auto angleToNormal = [&](double t) {
    const TreeFrame f = map.frame({0, t * speed});
    const Eigen::Vector3d inward(-std::cos(t), -std::sin(t), 0);
    return std::atan2(inward.dot(f.binormal), inward.dot(f.normal));
  };
  // The normal turns against a carried frame by torsion b / (a^2 + b^2) for each metre; chords of 4 mm on a radius of
  // 25 mm see it too short by a part of (2 / 25)^2 / 6, and less than all of it near the ends, where they
  // are cut short.
  const double turned = angleToNormal(3.5) - angleToNormal(0.5);
  EXPECT_NEAR(std::remainder(turned - 3.0 * speed * b / (speed * speed), 2 * kPi), 0, 3e-3);
  // Curvature a / (a^2 + b^2) adds up to what it has turned; chords lose a little at the ends.
  const double bend = map.turned_rad({0, 3.5 * speed}) - map.turned_rad({0, 0.5 * speed});
  EXPECT_NEAR(bend, 3.0 * speed * a / (speed * speed), 1e-2);
}

}  // namespace
}  // namespace angio::test
