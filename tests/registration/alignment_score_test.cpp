// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/alignment_score.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"

namespace angio::test {
namespace {

// One pixel a millimetre at a depth of one metre.
XrayCamera plainCamera() {
  XrayCamera::Parameters p;
  p.width_px = p.height_px = 200;
  p.fx_px = p.fy_px = 1000;
  p.cx_px = p.cy_px = 100;
  return XrayCamera(p);
}

Pose oneMetreAway() {
  Pose T = Pose::Identity();
  T.translation().z() = 1;
  return T;
}

// A straight vessel of 11 points, from (50, 100) to (150, 100) px.
VesselTree straightVessel() {
  Eigen::Matrix3Xd points = Eigen::Matrix3Xd::Zero(3, 11);
  std::vector<int> parents;
  for (int i = 0; i < 11; ++i) {
    points(0, i) = -0.05 + 0.01 * i;
    parents.push_back(i - 1);
  }
  return VesselTree(points, parents);
}

Centerline2d line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, int n) {
  Eigen::Matrix2Xd points(2, n);
  for (int i = 0; i < n; ++i) points.col(i) = from + (to - from) * i / (n - 1);
  return makeCenterline(points, std::vector<int>(n, 0));
}

AlignmentScore alignmentScoreWith(const Centerline2d& image) {
  const VesselTree tree = straightVessel();
  return alignmentScore(tree, tree.points(), image, plainCamera(), oneMetreAway());
}

TEST(AlignmentScore, IsCompleteAtTheTruePoseOfACleanPhantom) {
  test::Random random(1);
  for (unsigned seed = 0; seed < 4; ++seed) {
    const VesselTree tree = test::branchingTree(seed);
    const XrayCamera camera = test::clinicalCamera();
    const Pose T = test::viewOf(tree, random);
    const AlignmentScore a = alignmentScore(tree, tree.points(), projectedCenterline(tree, camera, T), camera, T);
    // The image's tangents are those of chords: at a sharp bend a point or two in a thousand run another way.
    EXPECT_GT(a.model_explained, 0.995);
    EXPECT_GT(a.image_explained, 0.995);
    EXPECT_NEAR(a.model_residual_px, 0, 1e-9);
    EXPECT_NEAR(a.image_residual_px, 0, 1e-9);
    EXPECT_NEAR(a.model_rms_px, 0, 1e-9);
    int in_view = 0;
    for (int i = 0; i < tree.size(); ++i) in_view += camera.sees(*camera.project(T * tree.points().col(i)));
    EXPECT_EQ(a.model_points, in_view);
  }
}

TEST(AlignmentScore, IsLowAtAWrongPose) {
  test::Random random(2);
  for (unsigned seed = 0; seed < 4; ++seed) {
    const VesselTree tree = test::branchingTree(seed);
    const XrayCamera camera = test::clinicalCamera();
    const Pose T = test::viewOf(tree, random);
    Twist off = Twist::Zero();
    off.head<3>() = T.linear().transpose() * Eigen::Vector3d(0.015, 0.010, 0);
    off[5] = 0.3;
    const AlignmentScore a = alignmentScore(tree, tree.points(), projectedCenterline(tree, camera, T), camera,
                                            test::perturbed(T, tree, off));
    // A third of either side by chance: a dense tree's vessels lie a few gates apart.
    EXPECT_LT(a.model_explained, 0.35);
    EXPECT_LT(a.image_explained, 0.35);
  }
}

TEST(AlignmentScore, ParallelVesselsAreExplainedUpToTheGate) {
  const AlignmentScore near = alignmentScoreWith(line({50, 102}, {150, 102}, 101));
  EXPECT_NEAR(near.score(), 1, 1e-12);
  EXPECT_NEAR(near.model_residual_px, 2, 1e-9);
  EXPECT_NEAR(near.image_residual_px, 2, 1e-9);
  EXPECT_NEAR(near.model_rms_px, 2, 1e-9);
  EXPECT_EQ(alignmentScoreWith(line({50, 103.5}, {150, 103.5}, 101)).score(), 0);
}

TEST(AlignmentScore, HalfAVesselExplainsHalfTheOther) {
  // The image holds the left half only: 51 of its points, and the model's first 6 of 11 and none beyond 3 px.
  const AlignmentScore a = alignmentScoreWith(line({50, 100}, {100, 100}, 51));
  EXPECT_NEAR(a.model_explained, 6.0 / 11, 1e-12);
  EXPECT_NEAR(a.image_explained, 1, 1e-12);
  EXPECT_NEAR(a.model_residual_px, (10 + 20 + 30 + 40 + 50) / 11.0, 1e-9);
  EXPECT_NEAR(a.model_rms_px, std::sqrt((100 + 400 + 900 + 1600 + 2500) / 11.0), 1e-9);
}

TEST(AlignmentScore, AVesselThatCrossesExplainsNothing) {
  const AlignmentScore a = alignmentScoreWith(line({100, 50}, {100, 150}, 101));
  EXPECT_EQ(a.model_explained, 0);
  EXPECT_EQ(a.image_explained, 0);
}

TEST(AlignmentScore, MeasuresImagePointsToEdgesNotToModelPoints) {
  // Half way between two model points, 10 px apart, and 1 px aside.
  const AlignmentScore a = alignmentScoreWith(line({55, 101}, {95, 101}, 5));
  EXPECT_NEAR(a.image_residual_px, 1, 1e-9);
  EXPECT_NEAR(a.image_explained, 1, 1e-12);
}

TEST(AlignmentScore, ALineWhosePointsStandFarApartExplainsWhatLiesBetweenThem) {
  // Its points are 25 px apart, those of the model 10 px: most of these lie between two of the image's.
  const AlignmentScore a = alignmentScoreWith(line({50, 102}, {150, 102}, 5));
  EXPECT_NEAR(a.score(), 1, 1e-12);
  EXPECT_NEAR(a.model_rms_px, 2, 0.2);  // To points 3 px apart at most: sqrt(4 + 3 / 4) on average.
  // Across a gap there is no vessel.
  Eigen::Matrix2Xd ends(2, 2);
  ends << 50, 150, 102, 102;
  EXPECT_NEAR(alignmentScoreWith(makeCenterline(ends, {0, 1})).model_explained, 2.0 / 11, 1e-12);
}

TEST(AlignmentScore, CountsOnlyTheModelOnTheDetector) {
  const VesselTree tree = straightVessel();
  Pose T = oneMetreAway();
  T.translation().x() = -0.105;  // Half of the vessel and one point leave at the left.
  const AlignmentScore a = alignmentScore(tree, tree.points(), line({5, 100}, {45, 100}, 41), plainCamera(), T);
  EXPECT_EQ(a.model_points, 5);
  EXPECT_NEAR(a.score(), 1, 1e-12);
}

TEST(AlignmentScore, CountsOnlyTheModelInsideTheCollimator) {
  const VesselTree tree = straightVessel();
  const Centerline2d image = line({50, 100}, {95, 100}, 46);
  const XrayCamera camera = plainCamera();
  // Open from 40 to 95 px: the first 5 of 11 points.
  const XrayViews views{{image, camera, Pose::Identity(), {{40, 40}, {95, 40}, {95, 160}, {40, 160}}}};
  const AlignmentScore a = alignmentScore(tree, tree.points(), views, oneMetreAway());
  EXPECT_EQ(a.model_points, 5);
  EXPECT_NEAR(a.model_explained, 1, 1e-12);
}

// Views to the left and right of the first one, by shifts that put the vessel elsewhere on the detector or beside it.
XrayView shifted(const Centerline2d& image, const XrayCamera& camera, double by_m) {
  XrayView view{image, camera};
  view.T_view_first.translation().x() = by_m;
  return view;
}

TEST(AlignmentScore, WeighsViewsByTheirPoints) {
  const VesselTree tree = straightVessel();
  const XrayCamera camera = plainCamera();
  // 11 model points and 101 image points 2 px apart; and 10 mm to the right the same 11 and 51 of their left half.
  const Centerline2d whole = line({50, 102}, {150, 102}, 101), half = line({60, 100}, {110, 100}, 51);
  const AlignmentScore a =
      alignmentScore(tree, tree.points(), {shifted(whole, camera, 0), shifted(half, camera, 0.01)}, oneMetreAway());
  EXPECT_EQ(a.model_points, 22);
  EXPECT_NEAR(a.model_explained, (11 + 6) / 22.0, 1e-12);
  EXPECT_NEAR(a.image_explained, 1, 1e-12);
  EXPECT_NEAR(a.model_residual_px, (11 * 2 + 10 + 20 + 30 + 40 + 50) / 22.0, 1e-9);
  EXPECT_NEAR(a.image_residual_px, 101 * 2 / 152.0, 1e-9);
}

TEST(AlignmentScore, AViewThatShowsWhatTheModelDoesNotIsUnexplained) {
  const VesselTree tree = straightVessel();
  const XrayCamera camera = plainCamera();
  const Centerline2d right = line({50, 100}, {150, 100}, 101), nothing = makeCenterline(Eigen::Matrix2Xd(2, 0));
  // Half a metre away the model is off the detector, and the image there is of something else.
  const AlignmentScore beside =
      alignmentScore(tree, tree.points(), {shifted(right, camera, 0), shifted(right, camera, 0.5)}, oneMetreAway());
  EXPECT_EQ(beside.model_points, 11);
  EXPECT_NEAR(beside.model_explained, 1, 1e-12);
  EXPECT_NEAR(beside.image_explained, 0.5, 1e-12);
  // And a model in view where the image shows nothing.
  const AlignmentScore blank =
      alignmentScore(tree, tree.points(), {shifted(right, camera, 0), shifted(nothing, camera, 0)}, oneMetreAway());
  EXPECT_NEAR(blank.model_explained, 0.5, 1e-12);
  EXPECT_NEAR(blank.image_explained, 1, 1e-12);
  EXPECT_NEAR(blank.model_residual_px, 0, 1e-9);
}

TEST(AlignmentScore, IsNothingWithoutAnImageOrAModelInView) {
  const VesselTree tree = straightVessel();
  const AlignmentScore empty = alignmentScoreWith(makeCenterline(Eigen::Matrix2Xd(2, 0)));
  EXPECT_EQ(empty.score(), 0);
  EXPECT_EQ(empty.model_residual_px, 0);
  Pose behind = oneMetreAway();
  behind.translation().z() = -1;
  const AlignmentScore none =
      alignmentScore(tree, tree.points(), line({50, 100}, {150, 100}, 11), plainCamera(), behind);
  EXPECT_EQ(none.model_points, 0);
  EXPECT_EQ(none.score(), 0);
}

}  // namespace
}  // namespace angio::test
