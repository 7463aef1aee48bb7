// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/vessel_tree.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include <limits>
#include <set>

#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

struct Draft {
  Eigen::Matrix3Xd points;
  std::vector<int> parents;
  std::vector<std::optional<double>> radii;
};

// Two trees with a bifurcation each; some parents stand after their children.
//   2 - 0 - 1 - 3     5 - 4,  5 - 6
//           1 - 7
Draft forest() {
  Draft d;
  d.parents = {2, 0, -1, 1, 5, -1, 5, 1};
  d.points.resize(3, 8);
  d.points << 0.01, 0.02, 0, 0.03, 0.10, 0.11, 0.12, 0.02,  //
      0, 0, 0, 0, 0.01, 0.01, 0.01, 0.01,                   //
      0, 0, 0, 0.001, 0, 0, 0, 0;
  d.radii.assign(8, std::nullopt);
  return d;
}

TEST(VesselTree, TakesAForestWhoseParentsStandAnywhere) {
  const Draft d = forest();
  const VesselTree tree(d.points, d.parents);
  EXPECT_EQ(tree.size(), 8);
  EXPECT_EQ(tree.children()[1], (std::vector<int>{3, 7}));
  EXPECT_FALSE(tree.radii()[0].has_value());
  // 10 mm edges but for the one that climbs 1 mm.
  EXPECT_NEAR(tree.length(), 5 * 0.01 + std::hypot(0.01, 0.001), 1e-15);
  EXPECT_LT((tree.centroid() - d.points.rowwise().mean()).norm(), 1e-15);
}

TEST(VesselTree, ParentsFirstHoldsEveryPointOnceAfterItsParent) {
  const Draft d = forest();
  const std::vector<int> order = VesselTree(d.points, d.parents).parentsFirst();
  std::set<int> seen{-1};
  for (const int i : order) {
    EXPECT_TRUE(seen.count(d.parents[i])) << i;
    EXPECT_TRUE(seen.insert(i).second) << i;
  }
  EXPECT_EQ(order.size(), d.parents.size());
}

TEST(VesselTree, FindsTheDefectAndItsPoint) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  struct Case {
    const char* name;
    std::function<void(Draft&)> spoil;
    int point;
    const char* field;
  };
  const Case cases[] = {
      {"own parent", [](Draft& d) { d.parents[4] = 4; }, 4, "parent"},
      {"missing parent", [](Draft& d) { d.parents[3] = 8; }, 3, "parent"},
      {"negative parent", [](Draft& d) { d.parents[6] = -2; }, 6, "parent"},
      {"not a number", [&](Draft& d) { d.points(1, 2) = nan; }, 2, "y_mm"},
      {"infinite", [&](Draft& d) { d.points(2, 7) = -inf; }, 7, "z_mm"},
      {"millimetres taken for metres", [](Draft& d) { d.points(0, 1) = 40.8; }, 1, "x_mm"},
      {"no radius", [](Draft& d) { d.radii[5] = 0; }, 5, "radius_mm"},
      {"radius not a number", [&](Draft& d) { d.radii[5] = nan; }, 5, "radius_mm"},
      {"no edges", [](Draft& d) { d.parents.assign(8, -1); }, 0, "parent"},
  };
  for (const Case& c : cases) {
    Draft d = forest();
    c.spoil(d);
    const auto defect = VesselTree::findDefect(d.points, d.parents, d.radii);
    ASSERT_TRUE(defect) << c.name;
    EXPECT_EQ(defect->point, c.point) << c.name;
    EXPECT_EQ(defect->field, c.field) << c.name;
    EXPECT_THAT(test::refusalOf([&] { VesselTree tree(d.points, d.parents, d.radii); }),
                testing::HasSubstr("point " + std::to_string(c.point) + ": " + c.field));
  }
  const Draft sound = forest();
  EXPECT_FALSE(VesselTree::findDefect(sound.points, sound.parents, sound.radii));
}

TEST(VesselTree, FindsALoopAtOneOfItsPointsNotAtOneThatHangsOnIt) {
  Draft d = forest();
  d.parents = {2, 0, 1, 1, 5, -1, 5, 1};  // 0 -> 2 -> 1 -> 0, with 3 and 7 hanging on it.
  const auto defect = VesselTree::findDefect(d.points, d.parents, d.radii);
  ASSERT_TRUE(defect);
  EXPECT_THAT((std::set<int>{0, 1, 2}), testing::Contains(defect->point));
  EXPECT_THAT(defect->rule, testing::HasSubstr("loop"));
}

TEST(VesselTree, RefusesFewerThanTwoPointsAndSizesThatDiffer) {
  EXPECT_THROW(VesselTree(Eigen::Matrix3Xd(3, 0), {}), InputError);
  EXPECT_THROW(VesselTree(Eigen::Vector3d::Zero(), {-1}), InputError);
  EXPECT_THROW(VesselTree(Eigen::Matrix3Xd::Zero(3, 3), {-1, 0}), InputError);
  EXPECT_THROW(VesselTree(Eigen::Matrix3Xd::Zero(3, 2), {-1, 0}, {std::nullopt}), InputError);
}

TEST(VesselTree, BranchesHoldEveryEdgeOnceAndEndWhereVesselsPart) {
  const Draft d = forest();
  for (const VesselTree& tree : {VesselTree(d.points, d.parents), test::branchingTree(3)}) {
    std::set<std::pair<int, int>> edges;
    for (const auto& branch : tree.branches()) {
      ASSERT_GE(branch.size(), 2u);
      for (std::size_t k = 1; k < branch.size(); ++k) {
        EXPECT_EQ(tree.parents()[branch[k]], branch[k - 1]);
        EXPECT_TRUE(edges.emplace(branch[k - 1], branch[k]).second) << "edge seen twice";
        if (k + 1 < branch.size()) {
          EXPECT_EQ(tree.children()[branch[k]].size(), 1u);
        }
      }
      EXPECT_TRUE(tree.parents()[branch.front()] < 0 || tree.children()[branch.front()].size() > 1);
      EXPECT_NE(tree.children()[branch.back()].size(), 1u);
    }
    const auto roots = std::count(tree.parents().begin(), tree.parents().end(), -1);
    EXPECT_EQ(edges.size(), static_cast<std::size_t>(tree.size() - roots));
  }
}

TEST(VesselTree, TangentsAreUnitAndFollowTheStraightestVessel) {
  const VesselTree phantom = test::branchingTree(4);
  EXPECT_LT((phantom.tangents().colwise().norm().array() - 1).abs().maxCoeff(), 1e-14);
  const Draft d = forest();
  const Eigen::Matrix3Xd tangents = VesselTree(d.points, d.parents).tangents();
  // At the bifurcation 1 the vessel goes on along x to 3, not aside along y to 7.
  EXPECT_GT(tangents(0, 1), 0.99);
  EXPECT_NEAR(tangents(1, 1), 0, 1e-15);
  EXPECT_LT((tangents.col(7) - Eigen::Vector3d::UnitY()).norm(), 1e-12);
  EXPECT_LT((tangents.col(4) + Eigen::Vector3d::UnitX()).norm(), 1e-12) << "away from the root";
}

TEST(VesselTree, TangentsAreFiniteWhereTwoPointsCoincide) {
  Eigen::Matrix3Xd points = Eigen::Matrix3Xd::Zero(3, 3);
  const VesselTree tree(points, {-1, 0, 1});
  EXPECT_TRUE(tree.tangents().allFinite());
}

}  // namespace
}  // namespace angio::test
