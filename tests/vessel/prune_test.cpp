// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/prune.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

// Two trees of 1 mm steps, the second one hung onto the first one's root.
VesselTree joined(const VesselTree& a, const VesselTree& b) {
  Eigen::Matrix3Xd points(3, a.size() + b.size());
  points << a.points(), b.points();
  std::vector<int> parents = a.parents();
  for (const int parent : b.parents()) parents.push_back(parent < 0 ? 0 : parent + a.size());
  std::vector<std::optional<double>> radii = a.radii();
  radii.insert(radii.end(), b.radii().begin(), b.radii().end());
  return VesselTree(points, parents, radii);
}

TEST(WithoutLongEdges, TakesTheJoinAndLeavesPointsEdgesAndRadii) {
  const VesselTree a = test::branchingTree(5), b = test::branchingTree(6, {0.03, 0, 0});
  const VesselTree tree = joined(a, b);
  const VesselTree forest = withoutLongEdges(tree, 0.010);
  EXPECT_EQ(forest.points(), tree.points());
  EXPECT_EQ(forest.radii(), tree.radii());
  std::vector<int> expected = tree.parents();
  expected[static_cast<std::size_t>(a.size())] = -1;
  EXPECT_EQ(forest.parents(), expected);
  EXPECT_EQ(forest.branches().size(), a.branches().size() + b.branches().size());
  EXPECT_EQ(withoutLongEdges(tree, 0.031).parents(), tree.parents());  // The join is 30 mm.
}

TEST(WithoutLongEdges, RefusesToLeaveNothing) {
  const VesselTree tree = test::branchingTree(5);
  EXPECT_NE(test::refusalOf([&] { withoutLongEdges(tree, 0.5e-3); }).find("max_edge_mm = 0.5: every edge is longer"),
            std::string::npos);
  EXPECT_NE(test::refusalOf([&] { withoutLongEdges(tree, 0); }).find("max_edge_mm = 0"), std::string::npos);
}

// A trunk of 0-1-2-3 along x with a branch 1-4 that is shorter than what lies beyond 2.
TEST(BeginningAt, CutsThroughAndKeepsTheLongerSide) {
  Eigen::Matrix3Xd points(3, 5);
  points.setZero();
  points.row(0) << 0, 0.01, 0.02, 0.03, 0.01;
  points(1, 4) = 0.05;
  const VesselTree tree(points, {-1, 0, 1, 2, 1}, {1e-3, 2e-3, 3e-3, 4e-3, 5e-3});
  const VesselTree cut = beginningAt(tree, {0.021, 0.001, 0});
  // From 2 back to 1, and from there both ways: 70 mm, against 10 mm to 3.
  ASSERT_EQ(cut.size(), 4);
  EXPECT_EQ(cut.points().col(0), points.col(2));
  EXPECT_EQ(cut.parents(), (std::vector<int>{-1, 0, 1, 1}));
  EXPECT_DOUBLE_EQ(cut.length(), 0.07);
  EXPECT_DOUBLE_EQ(*cut.radii()[0], 3e-3);
  // At an end nothing is lost.
  EXPECT_DOUBLE_EQ(beginningAt(tree, {0.04, 0, 0}).length(), tree.length());
  EXPECT_NE(test::refusalOf([&] {
              beginningAt(tree, {0, 0, std::nan("")});
            }).find("must be finite"),
            std::string::npos);
}

}  // namespace
}  // namespace angio::test
