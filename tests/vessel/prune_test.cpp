// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/prune.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"

namespace angio {
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
  EXPECT_NE(
      test::refusalOf([&] { withoutLongEdges(tree, 0.5e-3); }).find("longest_edge_mm = 0.5: every edge is longer"),
      std::string::npos);
  EXPECT_NE(test::refusalOf([&] { withoutLongEdges(tree, 0); }).find("longest_edge_mm = 0"), std::string::npos);
}

}  // namespace
}  // namespace angio
