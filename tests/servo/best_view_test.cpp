// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/best_view.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

// Straight vessels of 1.5 mm radius, a point every millimetre: each from its first point along its direction.
VesselTree straightVessels(const std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>& vessels, int points = 41) {
  Eigen::Matrix3Xd all(3, static_cast<Eigen::Index>(vessels.size()) * points);
  std::vector<int> parents;
  for (const auto& [first, direction] : vessels) {
    for (int k = 0; k < points; ++k) {
      const int index = static_cast<int>(parents.size());
      all.col(index) = first + k * 1e-3 * direction.normalized();
      parents.push_back(k == 0 ? -1 : index - 1);
    }
  }
  return VesselTree(all, parents, std::vector<std::optional<double>>(parents.size(), 1.5e-3));
}

double degreesBetween(const ViewAngles& angles, const Eigen::Vector3d& direction) {
  return radToDeg(std::acos(std::abs(beamDirection(angles).dot(direction.normalized()))));
}

TEST(BestView, AVesselInFreeSpaceIsSeenFromTheSide) {
  test::Random random(1);
  for (int i = 0; i < 5; ++i) {
    const Eigen::Vector3d along = random.direction();
    const VesselTree tree = straightVessels({{{0.01, 0.02, 0.03}, along}});
    const BestView best = bestView(tree, segmentOfBranch(tree, 0), {});
    EXPECT_LT(best.cost.foreshortening, 1e-3);
    EXPECT_EQ(best.cost.overlap, 0);
    // What 90 deg of turning cost, 0.01, is worth 0.4 deg of tilt: 1 - cos.
    EXPECT_NEAR(degreesBetween(best.angles, along), 90, 1.0) << i;
    EXPECT_LT((best.target_model - tree.points().col(20)).norm(), 1e-3);
  }
}

// A vessel along the patient's axis is seen from the side at every primary angle; one that crosses it in front and one
// beside it leave few of them free.
TEST(BestView, AVesselThatCrossesIsAvoided) {
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  const VesselTree alone = straightVessels({{{0, 0, -0.02}, z}});
  EXPECT_NEAR(bestView(alone, segmentOfBranch(alone, 0), {}).angles.primary_rad, 0, degToRad(0.2));
  // In the frontal view 20 mm before it, all along.
  const VesselTree covered = straightVessels({{{0, 0, -0.02}, z}, {{0, -0.02, -0.02}, z}});
  const BestView best = bestView(covered, segmentOfBranch(covered, 0), {});
  EXPECT_EQ(best.cost.overlap, 0);
  // Clear when the axes are 3 mm apart in projection: asin(3 / 20) = 8.6 deg, less the perspective.
  EXPECT_NEAR(std::abs(radToDeg(best.angles.primary_rad)), 8.6, 0.5);
  const auto column = static_cast<Eigen::Index>(std::lround(-best.map.first_primary_rad / best.map.step_rad));
  const auto row = static_cast<Eigen::Index>(std::lround(-best.map.first_secondary_rad / best.map.step_rad));
  EXPECT_GT(best.map.overlap(row, column), 0.9);
}

TEST(BestView, VesselsThatAreJoinedDoNotCover) {
  // A fork: the branch touches its parent and its sibling in every view.
  const VesselTree tree = test::branchingTree(4);
  const TreeSegment branch = segmentOfBranch(tree, 1);
  const BestView best = bestView(tree, branch, {});
  EXPECT_LT(best.cost.overlap, 0.1);
  EXPECT_LT(best.cost.foreshortening, 0.1);
}

TEST(BestView, TurnsWithTheModelsAxesAndKeepsToWhatIsReachable) {
  test::Random random(2);
  const VesselTree tree = test::branchingTree(3);
  const TreeSegment branch = segmentOfBranch(tree, 3);
  const BestView straight = bestView(tree, branch, {});
  BestViewScene scene;
  scene.R_lps_model = expSO3(random.vector(0.5));
  const VesselTree turned(scene.R_lps_model.transpose() * tree.points(), tree.parents(), tree.radii());
  const BestView same = bestView(turned, branch, scene);
  EXPECT_LT(degreesBetween(same.angles, beamDirection(straight.angles)), 0.5);  // Single precision, flat minima.
  scene = {};
  scene.reachable = [](const ViewAngles& angles) { return angles.primary_rad >= degToRad(40); };
  const BestView limited = bestView(tree, branch, scene);
  EXPECT_GE(limited.angles.primary_rad, degToRad(40));
  EXPECT_FALSE(limited.map.reachable(0, 0));
  scene.reachable = [](const ViewAngles&) { return false; };
  EXPECT_EQ(test::refusalOf([&] { bestView(tree, branch, scene); }), "best view: range: no view is reachable");
}

TEST(BestView, SegmentsAreChecked) {
  const VesselTree tree = test::branchingTree(3);
  const TreeSegment branch = segmentOfBranch(tree, 2);
  EXPECT_EQ(segmentBetween(tree, branch.front(), branch.back()), branch);
  EXPECT_NE(test::refusalOf([&] { segmentBetween(tree, branch.back(), branch.front()); }).find("downstream"),
            std::string::npos);
  EXPECT_NE(test::refusalOf([&] { segmentBetween(tree, 0, tree.size()); }).find("no such point"), std::string::npos);
  EXPECT_NE(test::refusalOf([&] { segmentOfBranch(tree, -1); }).find("branch = -1"), std::string::npos);
  EXPECT_NE(test::refusalOf([&] { bestView(tree, {branch.front()}, {}); }).find("two points"), std::string::npos);
}

}  // namespace
}  // namespace angio::test
