// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/tree_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "angio/geometry/se3.hpp"
#include "angio/test/phantoms.hpp"

namespace angio {
namespace {

constexpr double kRounding = 1e-12;

TEST(TreeMap, PathsLengthsAndPlacesAreTheTrees) {
  const VesselTree tree = test::branchingTree(1);
  const TreeMap map(tree);
  ASSERT_EQ(map.chains(), static_cast<int>(tree.branches().size()));
  double sum = 0;
  for (int c = 0; c < map.chains(); ++c) {
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
    const TreeSpot spot = map.spot({c, 0.4 * map.length_m(c)});
    const Eigen::Vector3d p = (1 - spot.weight) * tree.points().col(spot.a) + spot.weight * tree.points().col(spot.b);
    EXPECT_LT((p - map.point({c, 0.4 * map.length_m(c)})).norm(), kRounding);
  }
  EXPECT_NEAR(sum, tree.length(), 1e-9);
  EXPECT_THROW(static_cast<void>(map.point({map.chains(), 0})), std::out_of_range);
}

TEST(TreeMap, FramesAreRightHandedAlongTheVesselAndGoOnIntoTheChildren) {
  const TreeMap map(test::branchingTree(2));
  for (int c = 0; c < map.chains(); ++c) {
    for (double s = 0; s < map.length_m(c); s += 1.7e-3) {
      const TreeFrame f = map.frame({c, s});
      EXPECT_NEAR(f.along.norm(), 1, 1e-9);
      EXPECT_LT((f.along.cross(f.across) - f.aside).norm(), 1e-9);
    }
  }
}

// A helix has no straight piece: carried frames turn about it by its torsion, and nothing else turns them.
TEST(TreeMap, FramesTurnAgainstAHelixByItsTorsion) {
  const double a = 0.02, b = 0.01, speed = std::hypot(a, b);
  const int n = 2001;
  Eigen::Matrix3Xd points(3, n);
  std::vector<int> parents(n);
  for (int i = 0; i < n; ++i) {
    const double t = 4.0 * i / (n - 1);
    points.col(i) << a * std::cos(t), a * std::sin(t), b * t;
    parents[i] = i - 1;
  }
  const TreeMap map(VesselTree(points, parents));
  const auto angleToNormal = [&](double t) {
    const TreeFrame f = map.frame({0, t * speed});
    const Eigen::Vector3d inward(-std::cos(t), -std::sin(t), 0);
    return std::atan2(inward.dot(f.aside), inward.dot(f.across));
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
}  // namespace angio
