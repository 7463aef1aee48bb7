// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/direct_linear.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/random.hpp"

namespace angio::test {
namespace {

Eigen::Matrix3d intrinsics() {
  Eigen::Matrix3d K;
  K << 4389, 3, 520, 0, 4400, 470, 0, 0, 1;
  return K;
}

Pose randomView(test::Random& random) {
  Pose T = Pose::Identity();
  const double angle_rad = random.uniform(0, 3);
  T.linear() = expSO3(angle_rad * random.direction());
  T.translation() = Eigen::Vector3d(random.uniform(-0.02, 0.02), 0.01, 0.8);
  return T;
}

Eigen::Matrix3Xd cloud(test::Random& random, int count) {
  Eigen::Matrix3Xd points(3, count);
  for (int i = 0; i < count; ++i) points.col(i) = random.vector(0.04);
  return points;
}

Matrix34d projectionOf(const Eigen::Matrix3d& K, const Pose& T) { return K * T.matrix().topRows<3>(); }

TEST(DirectLinear, FindsTheCameraOfExactPoints) {
  test::Random random(1);
  for (int i = 0; i < 50; ++i) {
    const Pose T = randomView(random);
    const Eigen::Matrix3Xd points = cloud(random, i < 10 ? 6 : 30);
    const auto P = directLinearTransform(points, projectedBy(projectionOf(intrinsics(), T), points));
    ASSERT_TRUE(P);
    const ProjectionParts parts = decomposed(*P);
    EXPECT_FALSE(parts.mirrored);
    // Six points at random may lie badly: 1e-16 times a condition of 1e8 or so.
    const double tolerance = i < 10 ? 1e-4 : 1e-8;
    EXPECT_LT((parts.K - intrinsics()).norm() / 4389, tolerance);
    EXPECT_LT((parts.T_camera_model.matrix() - T.matrix()).norm(), tolerance);
  }
}

TEST(DirectLinear, KnowsAMirroredImage) {
  test::Random random(2);
  const Pose T = randomView(random);
  const Eigen::Matrix3Xd points = cloud(random, 20);
  Eigen::Matrix2Xd px = projectedBy(projectionOf(intrinsics(), T), points);
  px.row(0) *= -1;
  const auto P = directLinearTransform(points, px);
  ASSERT_TRUE(P);
  const ProjectionParts parts = decomposed(*P);
  EXPECT_TRUE(parts.mirrored);
  EXPECT_LT((parts.T_camera_model.matrix() - T.matrix()).norm(), 1e-7);
}

TEST(DirectLinear, LeavesOpenWhatPointsLeaveOpen) {
  test::Random random(3);
  const Pose T = randomView(random);
  Eigen::Matrix3Xd points = cloud(random, 20);
  const Eigen::Matrix3Xd few = points.leftCols(5);
  EXPECT_FALSE(directLinearTransform(few, projectedBy(projectionOf(intrinsics(), T), few)));
  points.row(2).setZero();
  const Eigen::Matrix2Xd px = projectedBy(projectionOf(intrinsics(), T), points);
  EXPECT_FALSE(directLinearTransform(points, px)) << "points of a plane";
  points.row(1).setZero();
  EXPECT_FALSE(directLinearHomography(points.topRows<2>(), projectedBy(projectionOf(intrinsics(), T), points)))
      << "points of a line";
}

TEST(DirectLinear, PosesOfAPlaneAreExact) {
  test::Random random(4);
  Eigen::Matrix3Xd points = cloud(random, 20);
  points.row(2).setZero();
  for (int i = 0; i < 5; ++i) {
    const Pose T = randomView(random);
    const auto H = directLinearHomography(points.topRows<2>(), projectedBy(projectionOf(intrinsics(), T), points));
    ASSERT_TRUE(H);
    EXPECT_LT((planarPose(*H, intrinsics()).matrix() - T.matrix()).norm(), 1e-7);
  }
}

}  // namespace
}  // namespace angio::test
