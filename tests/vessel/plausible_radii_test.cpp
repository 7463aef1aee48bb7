// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/plausible_radii.hpp"

namespace angio::test {
namespace {

constexpr double kEnd = 0.6e-3;  // [m]

VesselTree withoutRadii(const VesselTree& tree) { return VesselTree(tree.points(), tree.parents()); }

TEST(PlausibleRadii, FollowMurraysLawAtEveryBifurcation) {
  const VesselTree tree = withPlausibleRadii(withoutRadii(test::branchingTree(3)), kEnd);
  int bifurcations = 0;
  for (int i = 0; i < tree.size(); ++i) {
    const auto& children = tree.children()[i];
    if (children.empty()) {
      EXPECT_DOUBLE_EQ(*tree.radii()[i], kEnd);
    }
    if (children.size() < 2) continue;
    ++bifurcations;
    double cubes = 0;
    for (int child : children) {
      // The branch's own radius is that of its middle, behind the taper.
      while (tree.children()[child].size() == 1) child = tree.children()[child].front();
      cubes += std::pow(*tree.radii()[child], 3);
    }
    EXPECT_NEAR(*tree.radii()[i], std::cbrt(cubes), 1e-12);
  }
  EXPECT_GT(bifurcations, 5);
}

TEST(PlausibleRadii, NeverGrowAwayFromTheRootAndStayBelowFourMillimetres) {
  const VesselTree tree = withPlausibleRadii(withoutRadii(test::branchingTree(4)), 2e-3);
  double widest = 0;
  for (int i = 0; i < tree.size(); ++i) {
    widest = std::max(widest, *tree.radii()[i]);
    if (tree.parents()[i] < 0) continue;
    EXPECT_LE(*tree.radii()[i], *tree.radii()[tree.parents()[i]] + 1e-15);  // Rounding of the taper.
  }
  EXPECT_DOUBLE_EQ(widest, 4e-3);
}

TEST(PlausibleRadii, KeepWhatTheTreeKnows) {
  // A stem of five points that forks in two; its second and fourth radius are known, and one of the branches'.
  Eigen::Matrix3Xd points(3, 9);
  for (int i = 0; i < 5; ++i) points.col(i) = Eigen::Vector3d(0, 0.01 * i, 0);
  points.col(5) << 0.01, 0.05, 0;
  points.col(6) << 0.02, 0.06, 0;
  points.col(7) << -0.01, 0.05, 0;
  points.col(8) << -0.02, 0.06, 0;
  std::vector<std::optional<double>> radii(9);
  radii[1] = 3e-3;
  radii[3] = 2e-3;
  radii[6] = 0.9e-3;
  const VesselTree tree = withPlausibleRadii(VesselTree(points, {-1, 0, 1, 2, 3, 4, 5, 4, 7}, radii), kEnd);
  EXPECT_EQ(tree.radii()[1], 3e-3);
  EXPECT_NEAR(*tree.radii()[2], 2.5e-3, 1e-15);
  EXPECT_EQ(tree.radii()[3], 2e-3);
  EXPECT_EQ(tree.radii()[6], 0.9e-3);
  EXPECT_EQ(tree.radii()[8], kEnd);

  const VesselTree known = test::branchingTree(5);
  EXPECT_EQ(withPlausibleRadii(known, kEnd).radii(), known.radii());
}

TEST(PlausibleRadii, RefusesAnImpossibleEnd) {
  EXPECT_THROW(withPlausibleRadii(test::branchingTree(1), 0), InputError);
  EXPECT_THROW(withPlausibleRadii(test::branchingTree(1), std::nan("")), InputError);
}

}  // namespace
}  // namespace angio::test
