// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/localisation/catheter_localiser.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "angio/base/errors.hpp"
#include "drawn_catheter.hpp"

namespace angio::test {
namespace {

constexpr double kDepth_m = 0.8;
const double kNan = std::numeric_limits<double>::quiet_NaN();

// Straight down the image, seen face on; the model's origin in the middle of the detector.
SeenPose faceOn() {
  Pose T = Pose::Identity();
  T.translation().z() = kDepth_m;
  return {XrayCamera::centered(1024, 1024, 0.00025, 1.0), T, Matrix6d::Zero()};
}

// A trunk and two branches. The second lies exactly behind the first, on the same rays, for `hidden_m`; then it turns
// away.
VesselTree fork(double hidden_m) {
  std::vector<Eigen::Vector3d> points;
  std::vector<int> parents;
  const auto add = [&](const Eigen::Vector3d& p, int parent) {
    points.push_back(p);
    parents.push_back(parent);
    return static_cast<int>(points.size()) - 1;
  };
  int at = -1;
  for (int k = 0; k <= 30; ++k) at = add({0.02 * std::sin(0.15 * k), -0.06 + 2e-3 * k, 0}, at);
  const int split = at;
  const Eigen::Vector3d start = points[split];
  for (int k = 1; k <= 30; ++k) at = add(start + Eigen::Vector3d(1e-3 * k, 1e-3 * k, 0), at);
  at = split;
  for (int k = 1; k <= 30; ++k) {
    const double beyond_m = std::max(0.0, 1e-3 * k * std::sqrt(2.0) - hidden_m);
    Eigen::Vector3d p = start + Eigen::Vector3d(1e-3 * k + 0.7 * beyond_m, 1e-3 * k - 0.7 * beyond_m, 0);
    const double deeper = 1 + 0.02 * std::min(1.0, k / 5.0);  // Away from the source along its own ray.
    p = deeper * (p + Eigen::Vector3d(0, 0, kDepth_m)) - Eigen::Vector3d(0, 0, kDepth_m);
    at = add(p, at);
  }
  Eigen::Matrix3Xd matrix(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) matrix.col(static_cast<Eigen::Index>(i)) = points[i];
  return VesselTree(matrix, parents);
}

// The branch that turns away: of the two, the one whose end is further to the right.
int turningBranch(const TreeTopology& map) {
  return map.point({1, map.length_m(1)}).x() > map.point({2, map.length_m(2)}).x() ? 1 : 2;
}

TEST(CatheterLocaliser, FindsAnExactTipWithoutAStart) {
  const VesselTree tree = fork(0);
  const TreeTopology map(tree);
  for (const TreeLocation tip : {TreeLocation{0, 0.05}, TreeLocation{1, 0.02}, TreeLocation{2, 0.025}}) {
    CatheterLocaliser localiser({}, tree);
    const TipBelief belief = localiser.update(test::drawnCatheter(map, tip, faceOn()), faceOn(), {});
    EXPECT_EQ(belief.status, BeliefStatus::kSeen) << belief.why;
    EXPECT_EQ(belief.tip.branch, tip.branch);
    EXPECT_GT(belief.tip.probability, 0.95);
    // Half of the grid's step, and what the shift's prior leaves open along a vessel that hardly bends.
    EXPECT_NEAR(belief.tip.arc_m, tip.arc_m, 1e-3);
    EXPECT_LT((belief.tip.tip_model - map.point(tip)).norm(), 1e-3);
    EXPECT_GT(belief.tip.direction_model.dot(map.frame(tip).along), 0.98);
    EXPECT_NEAR(belief.tip.path_m, map.start_m(tip.branch) + belief.tip.arc_m, 1e-9);
    EXPECT_LT(*belief.residual_px, 1);
  }
}

TEST(CatheterLocaliser, FindsTheTipAtWhicheverEnd) {
  const VesselTree tree = fork(0);
  const TreeTopology map(tree);
  SeenCatheter seen = test::drawnCatheter(map, {1, 0.02}, faceOn());
  seen.points_px = seen.points_px.rowwise().reverse().eval();
  seen.tip_end = TipEnd::kUnknown;
  CatheterLocaliser localiser({}, tree);
  const TipBelief belief = localiser.update(seen, faceOn(), {});
  EXPECT_EQ(belief.tip.branch, 1);
  EXPECT_NEAR(belief.tip.arc_m, 0.02, 1e-3);
}

TEST(CatheterLocaliser, KeepsBothBranchesUntilTheyPart) {
  const VesselTree tree = fork(0.02);
  const TreeTopology map(tree);
  const int truth = turningBranch(map);
  CatheterLocaliser localiser({}, tree);
  TipBelief belief;
  for (double arc_m = 0.005; arc_m < 0.016; arc_m += 1e-3) {
    belief = localiser.update(test::drawnCatheter(map, {truth, arc_m}, faceOn()), faceOn(), {});
  }
  ASSERT_FALSE(belief.alternatives.empty());
  EXPECT_LT(belief.tip.probability, 0.8);
  EXPECT_GT(belief.alternatives.front().probability, 0.2);
  for (double arc_m = 0.016; arc_m < 0.035; arc_m += 1e-3) {
    belief = localiser.update(test::drawnCatheter(map, {truth, arc_m}, faceOn()), faceOn(), {});
  }
  EXPECT_EQ(belief.tip.branch, truth);
  EXPECT_GT(belief.tip.probability, 0.95);
}

TEST(CatheterLocaliser, TakesAShiftOfTheImageForWhatItIs) {
  const VesselTree tree = fork(0);
  const TreeTopology map(tree);
  CatheterLocaliser localiser({}, tree);
  const Eigen::Vector2d shift(6, -9);
  TipBelief belief;
  for (int frame = 0; frame < 5; ++frame) {
    belief = localiser.update(test::drawnCatheter(map, {1, 0.02}, faceOn(), shift), faceOn(), {});
  }
  EXPECT_NEAR(belief.tip.arc_m, 0.02, 1e-3);
  EXPECT_LT((belief.shift_px - shift).norm(), 3);
}

TEST(CatheterLocaliser, IsNotPulledAwayByAWrongFrame) {
  const VesselTree tree = fork(0);
  const TreeTopology map(tree);
  CatheterLocaliser localiser({}, tree);
  for (int frame = 0; frame < 5; ++frame) {
    (void)localiser.update(test::drawnCatheter(map, {1, 0.02}, faceOn()), faceOn(), {});
  }
  // The other branch, for one frame: a curve of contrast agent, say.
  TipBelief belief = localiser.update(test::drawnCatheter(map, {2, 0.03}, faceOn()), faceOn(), {});
  belief = localiser.update(test::drawnCatheter(map, {1, 0.02}, faceOn()), faceOn(), {});
  EXPECT_EQ(belief.tip.branch, 1);
  EXPECT_NEAR(belief.tip.arc_m, 0.02, 1.5e-3);
  // A line that is nowhere near the tree.
  SeenCatheter stray;
  stray.points_px = (Eigen::Matrix2Xd(2, 3) << 20, 300, 700, 900, 950, 1000).finished();
  belief = localiser.update(stray, faceOn(), {});
  EXPECT_NE(belief.status, BeliefStatus::kSeen);
  EXPECT_FALSE(belief.why.empty());
  EXPECT_EQ(belief.tip.branch, 1);
}

TEST(CatheterLocaliser, PredictsByThePushAndGrowsUnsure) {
  const VesselTree tree = fork(0);
  const TreeTopology map(tree);
  CatheterLocaliser localiser({}, tree);
  const TipBelief before = localiser.update(test::drawnCatheter(map, {0, 0.03}, faceOn()), faceOn(), {});
  CatheterLocaliser of_loose({}, tree);
  (void)of_loose.update(test::drawnCatheter(map, {0, 0.03}, faceOn()), faceOn(), {});
  TipBelief after, loose;
  for (int frame = 0; frame < 10; ++frame) {
    after = localiser.predict({1.0 / 15, 1e-3});
    loose = of_loose.predict({1.0 / 15, 1e-3, 2e-3});
  }
  EXPECT_EQ(after.status, BeliefStatus::kPredicted);
  EXPECT_NEAR(after.tip.path_m, before.tip.path_m + 0.01, 2e-3);
  EXPECT_GT(after.tip.std_m, before.tip.std_m);
  // Ten frames of 2 mm each, added in squares.
  EXPECT_NEAR(loose.tip.std_m, std::hypot(after.tip.std_m, std::sqrt(10.0) * 2e-3), 1e-3);
}

TEST(CatheterLocaliser, WhatSaysNothingOnlyPredicts) {
  const VesselTree tree = fork(0);
  const TreeTopology map(tree);
  const SeenCatheter good = test::drawnCatheter(map, {1, 0.02}, faceOn());
  std::vector<std::pair<SeenCatheter, SeenPose>> bad(8, {good, faceOn()});
  bad[0].first.points_px(1, 3) = kNan;
  bad[1].first.points_px.resize(2, 0);
  bad[2].first.points_px = good.points_px.leftCols(1).eval();
  bad[3].first.std_px = kNan;
  bad[4].second.T_camera_model.translation().z() = 0;  // The tree stands in the source.
  bad[5].second.T_camera_model.matrix()(0, 0) = kNan;
  bad[6].second.T_camera_model.linear() *= 1.5;
  bad[7].second.covariance(2, 2) = kNan;
  CatheterLocaliser localiser({}, tree);
  (void)localiser.update(good, faceOn(), {});
  for (const auto& [seen, pose] : bad) {
    const TipBelief belief = localiser.update(seen, pose, {kNan, std::numeric_limits<double>::infinity()});
    EXPECT_EQ(belief.status, BeliefStatus::kPredicted);
    EXPECT_FALSE(belief.why.empty());
    EXPECT_TRUE(belief.tip.tip_model.allFinite());
    EXPECT_TRUE(std::isfinite(belief.tip.probability) && belief.tip.probability > 0);
  }
  const TipBelief again = localiser.update(good, faceOn(), {});
  EXPECT_EQ(again.tip.branch, 1);
  EXPECT_NEAR(again.tip.arc_m, 0.02, 1.5e-3);
}

TEST(CatheterLocaliser, StartsWhereItIsTold) {
  const VesselTree tree = fork(0.02);
  CatheterLocaliser localiser({}, tree);
  EXPECT_EQ(localiser.belief().status, BeliefStatus::kUnknown);
  localiser.reset(2, 0.01, 1e-3);
  EXPECT_EQ(localiser.belief().tip.branch, 2);
  EXPECT_NEAR(localiser.belief().tip.arc_m, 0.01, 1e-3);
  EXPECT_THROW(localiser.reset(3, 0.01, 1e-3), InputError);
  EXPECT_THROW(localiser.reset(0, 1.0, 1e-3), InputError);
  EXPECT_THROW(localiser.reset(0, 0.01, kNan), InputError);
  LocaliserSettings settings;
  settings.spacing_mm = 0;
  EXPECT_THROW(CatheterLocaliser(settings, tree), InputError);
}

// The covariance of a pose widens what is looked for: a tip 30 px off is found by a pose that admits it, and only by
// that.
TEST(CatheterLocaliser, LooksAsFarAsThePoseIsUnsure) {
  const VesselTree tree = fork(0);
  const TreeTopology map(tree);
  LocaliserSettings settings;
  settings.shift_std_mm = 0.5;
  const auto seen = test::drawnCatheter(map, {1, 0.02}, faceOn(), {30, 30});
  CatheterLocaliser exact(settings, tree);
  EXPECT_NE(exact.update(seen, faceOn(), {}).status, BeliefStatus::kSeen);
  SeenPose unsure = faceOn();
  unsure.covariance.diagonal() << 1e-4, 1e-4, 1e-4, 1e-8, 1e-8, 1e-8;  // 10 mm.
  CatheterLocaliser wide(settings, tree);
  const TipBelief belief = wide.update(seen, unsure, {});
  EXPECT_EQ(belief.tip.branch, 1);
  EXPECT_LT((belief.shift_px - Eigen::Vector2d(30, 30)).norm(), 15);
}

// What is known each millimetre on both sides of a fork.
TipEvidence evidenceOf(const std::vector<PlaceEvidence>& places) {
  TipEvidence evidence;
  evidence.places = places;
  evidence.elsewhere = -12;
  return evidence;
}

TEST(CatheterLocaliser, FinePlacesLeaveNoHoleInEvidenceByTheMillimetre) {
  const VesselTree tree = fork(0.02);
  const TreeTopology map(tree);
  LocaliserSettings settings;
  settings.spacing_mm = 0.2;
  settings.backlash_mm = 0.1;
  CatheterLocaliser localiser(settings, tree);
  localiser.reset(0, map.length_m(0) - 2e-3, 0.5e-3);
  // A tip that goes from the trunk into branch 1, seen by places a millimetre apart: none between a fork and 1 mm.
  for (int k = 0; k < 60; ++k) {
    const double ahead_m = -2e-3 + 0.1e-3 * k;
    std::vector<PlaceEvidence> places;
    for (int mm = -6; mm <= 6; ++mm) {
      const double off = (1e-3 * mm - ahead_m) / 0.7e-3, value = std::max(-0.5 * off * off, -12.0);
      if (mm <= 0) places.push_back({0, map.length_m(0) + 1e-3 * mm, value});
      if (mm > 0) places.push_back({1, 1e-3 * mm, value});
      if (mm > 0) places.push_back({2, 1e-3 * mm, value - 3});
    }
    const TipBelief belief = localiser.update(evidenceOf(places), {1.0 / 15, 0.1e-3});
    const double path_m = map.start_m(belief.tip.branch) + belief.tip.arc_m;
    EXPECT_NEAR(path_m, map.length_m(0) + ahead_m, 0.6e-3) << k;
    EXPECT_LE(belief.tip.probability, 1) << k;  // What a message of a tip refuses.
    EXPECT_LE(belief.near_probability, 1) << k;
  }
  EXPECT_EQ(localiser.belief().tip.branch, 1);
}

TEST(CatheterLocaliser, IsUnsureWherePlacesFarApartExplainAFrameAlike) {
  const VesselTree tree = fork(0.02);
  const TreeTopology map(tree);
  LocaliserSettings settings;
  settings.min_probability = 0.8;
  CatheterLocaliser localiser(settings, tree);
  const auto at = [](int branch, double value) {
    std::vector<PlaceEvidence> places;
    for (int mm = -2; mm <= 2; ++mm) places.push_back({branch, 0.02 + 1e-3 * mm, value - 2 * mm * mm});
    return places;
  };
  std::vector<PlaceEvidence> both = at(1, 0), other = at(2, -0.5);
  both.insert(both.end(), other.begin(), other.end());
  const TipBelief doubtful = localiser.update(evidenceOf(both), {});
  EXPECT_EQ(doubtful.status, BeliefStatus::kUnsure);
  EXPECT_TRUE(isFromFrame(doubtful));
  EXPECT_NEAR(doubtful.near_probability, 1 / (1 + std::exp(-0.5)), 0.1);
  EXPECT_NE(doubtful.why.find("within 1.5 mm"), std::string::npos) << doubtful.why;
  const TipBelief sure = localiser.update(evidenceOf(at(1, 0)), {});
  EXPECT_EQ(sure.status, BeliefStatus::kSeen);
  EXPECT_GT(sure.near_probability, 0.9);
  // A place that is known, of a tip that may lean far along the beam.
  std::vector<PlaceEvidence> leaning = at(1, 0);
  for (PlaceEvidence& one : leaning) one.end_std_m = 1.5e-3;
  const TipBelief unseen = localiser.update(evidenceOf(leaning), {});
  EXPECT_EQ(unseen.status, BeliefStatus::kUnsure);
  EXPECT_NEAR(unseen.near_probability, 0.68, 0.05);
}

}  // namespace
}  // namespace angio::test
