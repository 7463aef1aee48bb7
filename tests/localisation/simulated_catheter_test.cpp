// SPDX-License-Identifier: GPL-2.0-or-later
// Catheters pushed to places all over a real liver's arteries, under noise and breathing.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "angio/io/vessel_files.hpp"
#include "angio/test/namespace.hpp"
#include "drawn_catheter.hpp"

namespace angio::test {
namespace {

struct Score {
  std::vector<double> error_mm, normalised;
  int frames = 0, sure = 0, sure_and_right = 0;

  double nees() const {
    double sum = 0;
    for (const double one : normalised) sum += one * one;
    return sum / static_cast<double>(normalised.size());
  }
};

double percentileOf(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * (values.size() - 1))];
}

// The camera of the clinical system, a view drawn at random, the tree's centroid near the isocentre.
SeenPose drawnView(const VesselTree& tree, std::mt19937& random) {
  std::uniform_real_distribution<double> turn(-0.6, 0.6), off(-0.02, 0.02);
  const Eigen::Matrix3d R = expSO3({turn(random), turn(random), 0.2 * turn(random)});
  Pose T = Pose::Identity();
  T.linear() = R;
  T.translation() = Eigen::Vector3d(off(random), off(random), 0.81) - R * tree.centroid();
  return {XrayCamera::centered(1024, 1024, 0.00025355859375, 1.113), T, Matrix6d::Zero()};
}

// Pushes a catheter into a leaf of the tree and scores what the localiser says of it, from the 10th frame on.
void pushInto(const VesselTree& tree, const TreeTopology& map, int leaf, bool told, std::mt19937& random,
              Score& score) {
  const SeenPose pose = drawnView(tree, random);
  std::normal_distribution<double> normal;
  const double px_per_m = pose.camera.parameters().fx_px / 0.81, phase = 6 * normal(random);
  const Eigen::Vector2d breath = 2e-3 * px_per_m * Eigen::Vector2d(0.3 * normal(random), 1).normalized();
  const double end_m = map.start_m(leaf) + map.length_m(leaf);
  const auto route = map.pathTo(leaf);
  double path_m = std::max(0.03, end_m - 0.06);
  CatheterLocaliser localiser({}, tree);
  for (int frame = 0; frame < 60; ++frame) {
    const double push_m = 1e-3 * std::max(0.0, 1 + 0.5 * normal(random));
    const double moved_m = std::min(push_m * (1 + 0.2 * normal(random)), end_m - 1e-4 - path_m);
    path_m += moved_m;
    TreeLocation tip{route.front(), 0};
    for (const int branch : route) {
      if (map.start_m(branch) <= path_m) tip = {branch, path_m - map.start_m(branch)};
    }
    const Eigen::Vector2d shift = std::sin(2 * kPi * frame / 60 + phase) * breath;
    const auto exact = test::drawnCatheter(map, tip, pose, shift);
    if (exact.points_px.cols() < 20 || !pose.camera.sees(exact.points_px.col(exact.points_px.cols() - 1))) continue;
    CatheterMotion motion;
    if (told) motion.pushed_m = push_m;
    const TipBelief belief = localiser.update(test::noisy(exact, 1, 1, random), pose, motion);
    if (frame < 10) continue;
    ++score.frames;
    const bool right = belief.tip.branch == tip.branch;
    score.sure += belief.tip.probability > 0.9;
    score.sure_and_right += right && belief.tip.probability > 0.9;
    score.error_mm.push_back(1e3 * (belief.tip.tip_model - map.point(tip)).norm());
    if (right && belief.tip.probability > 0.9)
      score.normalised.push_back((belief.tip.arc_m - tip.arc_m) / belief.tip.std_m);
  }
}

Score scoreOf(bool told, unsigned seed) {
  const VesselTree tree = readVesselTree(std::string(ANGIO_EXAMPLE_DATA) + "/hepatic-tace/tree.csv");
  const TreeTopology map(tree);
  std::vector<int> leaves;
  for (int branch = 0; branch < map.branchCount(); ++branch) {
    if (map.children(branch).empty() && map.start_m(branch) > 0.1) leaves.push_back(branch);
  }
  std::mt19937 random(seed);
  Score score;
  for (int run = 0; run < 15; ++run) {
    pushInto(tree, map, leaves[std::uniform_int_distribution<std::size_t>(0, leaves.size() - 1)(random)], told, random,
             score);
  }
  return score;
}

// The bound is the task's: 1.5 mm; what it claims to know it must know.
TEST(SimulatedCatheter, IsLocalisedWhenThePushIsKnown) {
  const Score score = scoreOf(true, 11);
  ASSERT_GT(score.frames, 500);
  EXPECT_LT(percentileOf(score.error_mm, 0.5), 0.5);
  EXPECT_LT(percentileOf(score.error_mm, 0.95), 1.5);
  EXPECT_GT(score.sure, score.frames / 2);
  EXPECT_GE(score.sure_and_right, 0.95 * score.sure);
  // Squared error by the claimed variance: below 1, as frames count for less than they say.
  EXPECT_LT(score.nees(), 1.5);
}

// Breathing along the vessel looks like the tip's own motion when nothing tells how far it was pushed.
TEST(SimulatedCatheter, IsLocalisedByImagesAlone) {
  const Score score = scoreOf(false, 12);
  ASSERT_GT(score.frames, 500);
  EXPECT_LT(percentileOf(score.error_mm, 0.5), 1);
  EXPECT_LT(percentileOf(score.error_mm, 0.95), 2.5);
  EXPECT_GT(score.sure, score.frames / 2);
  EXPECT_GE(score.sure_and_right, 0.9 * score.sure);
  EXPECT_LT(score.nees(), 2);
}

}  // namespace
}  // namespace angio::test
