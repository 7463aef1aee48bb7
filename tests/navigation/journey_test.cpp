// SPDX-License-Identifier: GPL-2.0-or-later
// Journeys of the shipped nodes of both machines against the simulated lab, in simulated time.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/experiments/navigate_experiment.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

struct Journey : testing::Test {
  NavigateResult journeyTo(const TreeLocation& target, int seed) const {
    return runNavigationExperiment(tree, readCArmCalibration(test::exampleData("hepatic-tace/carm.yaml")), target,
                                   experiment, {}, seed);
  }
  VesselTree tree = readVesselTree(test::exampleData("hepatic-tace/tree.csv"));
  NavigateExperimentSettings experiment;
};

// Journeys of seeds in a row must not begin alike.
TEST(NavigateCatheter, RollsOfSeedsInARowAreSpread) {
  std::vector<double> rolls_deg;
  for (int seed = 1001; seed <= 1016; ++seed) rolls_deg.push_back(navigateCatheter({}, seed).roll_zero_deg);
  std::sort(rolls_deg.begin(), rolls_deg.end());
  rolls_deg.push_back(rolls_deg.front() + 360);
  for (std::size_t i = 0; i + 1 < rolls_deg.size(); ++i) {
    // 22.5 deg apart are 16 that are spread evenly.
    EXPECT_GT(rolls_deg[i + 1] - rolls_deg[i], 10) << i;
    EXPECT_LT(rolls_deg[i + 1] - rolls_deg[i], 45) << i;
  }
}

TEST_F(Journey, ReachesABranchOverViewsThatItAskedFor) {
  experiment.min_route_mm = 40;
  const std::vector<TreeLocation> targets = navigateTargets(tree, experiment, 12);
  ASSERT_FALSE(targets.empty());
  const NavigateResult row = journeyTo(targets.front(), 1);
  EXPECT_TRUE(row.reached) << row.ended;
  EXPECT_GE(row.views, 1);
  EXPECT_FALSE(row.breach) << *row.breach;
  ASSERT_GT(row.errors_m.size(), 20u);
  const auto near = std::count_if(row.errors_m.begin(), row.errors_m.end(), [](double e) { return e < 1.5e-3; });
  EXPECT_GT(near, 0.8 * row.errors_m.size());
}

TEST_F(Journey, TargetsAlongCurvesAreSpreadOverTheirLengths) {
  experiment.min_route_mm = 0;
  const TreeTopology map(tree);
  const auto curve = [&](int branch) {
    Eigen::Matrix3Xd points(3, map.points(branch).size());
    for (Eigen::Index i = 0; i < points.cols(); ++i) points.col(i) = tree.points().col(map.points(branch)[i]);
    return points;
  };
  const std::vector<TreeLocation> targets = targetsAlong(tree, experiment, {curve(3), curve(4)}, 5);
  ASSERT_EQ(targets.size(), 5u);
  for (int k = 0; k < 5; ++k) EXPECT_EQ(targets[k].branch, k % 2 == 0 ? 3 : 4) << k;
  EXPECT_LT(targets[0].arc_m, targets[2].arc_m);
  EXPECT_LT(targets[2].arc_m, targets[4].arc_m);
  EXPECT_LT(targets[4].arc_m, map.length_m(3));
  EXPECT_LT(targets[1].arc_m, targets[3].arc_m);
  EXPECT_LT(targets[3].arc_m, map.length_m(4));
  experiment.min_route_mm = 1000;
  EXPECT_TRUE(targetsAlong(tree, experiment, {curve(3)}, 5).empty());
}

// A limit that the catheter's friction alone exceeds where the node pushes as fast as it may.
TEST_F(Journey, KeepsTheForceOfTheDriveBelowItsLimit) {
  experiment.min_route_mm = 40;
  experiment.max_s = 25;
  NavigateParts parts;
  parts.controller.loop.navigator.max_force_n = 0.03;
  const NavigateResult row =
      runNavigationExperiment(tree, readCArmCalibration(test::exampleData("hepatic-tace/carm.yaml")),
                              navigateTargets(tree, experiment, 12).front(), experiment, parts, 1);
  EXPECT_LE(row.max_force_n, 0.03);
  EXPECT_GT(row.max_force_n, 0.3 * 0.03) << "it pushes";
}

TEST_F(Journey, IsTheSameTwice) {
  experiment.max_s = 8;
  const TreeLocation target = navigateTargets(tree, experiment, 1).front();
  const NavigateResult a = journeyTo(target, 3), b = journeyTo(target, 3);
  EXPECT_EQ(a.errors_m, b.errors_m);
  EXPECT_EQ(a.held, b.held);
  EXPECT_EQ(a.time_s, b.time_s);
}

}  // namespace
}  // namespace angio::test
