// SPDX-License-Identifier: GPL-2.0-or-later

#include <gtest/gtest.h>

#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "rigid_step.hpp"

namespace angio::test {
namespace {

// Points at known distances from an image of a few points.
struct IrlsScene {
  Projected projected{4};
  PointMatcher image{(Eigen::Matrix2Xd(2, 3) << 0, 100, 106, 0, 0, 0).finished()};
  Pull pull{4};

  IrlsScene() {
    projected.pixel << 3, 100, 103, 0,  //
        4, 2, 0, 0;
    projected.may_pull = {1, 1, 1, 0};
    matchNearest(projected, image, pull);
  }
};

TEST(MatchNearest, FindsTheNearestAndSkipsWhatMayNotPull) {
  const IrlsScene s;
  EXPECT_EQ(s.pull.nearest[0], 0);
  EXPECT_EQ(s.pull.nearest[1], 1);
  EXPECT_EQ(s.pull.nearest[3], -1);
  EXPECT_EQ(s.pull.weight[3], 0);
  EXPECT_NEAR(s.pull.max_distance_px, 5, 1e-12);
}

TEST(Weigh, GaussianHuberAndL2AreAsDefined) {
  IrlsScene s;
  IterativePnpSettings settings;
  weigh(s.projected, s.image, {}, settings, 4, s.pull);
  EXPECT_NEAR(s.pull.weight[0], std::exp(-25.0 / 32), 1e-14);
  EXPECT_NEAR(s.pull.weight[1], std::exp(-4.0 / 32), 1e-14);
  EXPECT_EQ(s.pull.weight[3], 0);
  EXPECT_NEAR(s.pull.weighted_squares_px2,
              25 * std::exp(-25.0 / 32) + 4 * std::exp(-4.0 / 32) + 9 * std::exp(-9.0 / 32), 1e-12);

  settings.kernel = Kernel::kHuber;
  settings.huber_px = 2.5;
  weigh(s.projected, s.image, {}, settings, 4, s.pull);
  EXPECT_NEAR(s.pull.weight[0], 0.5, 1e-14);
  EXPECT_EQ(s.pull.weight[1], 1);

  settings.kernel = Kernel::kL2;
  weigh(s.projected, s.image, {}, settings, 4, s.pull);
  EXPECT_EQ(s.pull.weight[0], 1);
  EXPECT_EQ(s.pull.weight[3], 0);
}

TEST(Weigh, NeighboursAlongTheBranchPullLikeTheirSum) {
  IrlsScene s;
  IterativePnpSettings settings;
  settings.neighbours_each_side = 2;
  const double scale = 40;
  // The last point is of another branch, however near: it pulls only where it is the nearest itself.
  const std::vector<int> branch{0, 0, 1};
  weigh(s.projected, s.image, branch, settings, scale, s.pull);
  double squares = 0;
  for (int i = 0; i < 3; ++i) {
    const int nearest = s.pull.nearest[static_cast<std::size_t>(i)];
    // For fixed weights, sum_j w_ij |u - q_j|^2 and weight |u - target|^2 differ by a constant: same differences
    // anywhere.
    const auto sum = [&](const Eigen::Vector2d& u) {
      double total = 0;
      for (int j = 0; j < 3; ++j) {
        if (branch[static_cast<std::size_t>(j)] != branch[static_cast<std::size_t>(nearest)]) continue;
        const double d2 = (s.projected.pixel.col(i) - s.image.point(j)).squaredNorm();
        total += std::exp(-d2 / (2 * scale * scale)) * (u - s.image.point(j)).squaredNorm();
      }
      return total;
    };
    const auto pulled = [&](const Eigen::Vector2d& u) {
      return s.pull.weight[i] * (u - s.pull.target_px.col(i)).squaredNorm();
    };
    const Eigen::Vector2d a(3, -7), b(60, 20), c(-5, 90);
    EXPECT_NEAR(sum(a) - sum(b), pulled(a) - pulled(b), 1e-8);
    EXPECT_NEAR(sum(a) - sum(c), pulled(a) - pulled(c), 1e-8);
    squares += s.pull.weight[i] * (s.projected.pixel.col(i) - s.image.point(nearest)).squaredNorm();
  }
  // The covariance divides this by sums of the same weights: one neighbour's share of it would make poses look too
  // sure.
  EXPECT_NEAR(s.pull.weighted_squares_px2, squares, 1e-9);
}

TEST(Weigh, WithoutBranchesTheNearestPullsAlone) {
  IrlsScene s;
  IterativePnpSettings settings;
  settings.neighbours_each_side = 2;
  weigh(s.projected, s.image, {}, settings, 4, s.pull);
  EXPECT_NEAR((s.pull.target_px.col(1) - Eigen::Vector2d(100, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR(s.pull.weight[1], std::exp(-4.0 / 32), 1e-14);
}

TEST(Weigh, AWeightThatUnderflowsLeavesAFiniteTarget) {
  IrlsScene s;
  IterativePnpSettings settings;
  weigh(s.projected, s.image, {}, settings, 0.05, s.pull);
  EXPECT_EQ(s.pull.weight[0], 0);
  EXPECT_TRUE(s.pull.target_px.allFinite());
}

TEST(ProjectPoints, WhoMayPull) {
  const XrayCamera camera = test::clinicalCamera();
  Eigen::Matrix3Xd points(3, 3);
  points << 0, 0.5, 0,  //
      0, 0, 0,          //
      1, 1, -1;         // In view, beside the detector, behind the source.
  Projected projected(3);
  const Centerline2d none;
  XrayView view{none, camera};
  projectPoints(points, view, Pose::Identity(), OutsideImage::kVote, projected);
  EXPECT_EQ(projected.may_pull, (std::vector<char>{1, 1, 0}));
  projectPoints(points, view, Pose::Identity(), OutsideImage::kIgnore, projected);
  EXPECT_EQ(projected.may_pull, (std::vector<char>{1, 0, 0}));
  view.collimator_px = {{0, 0}, {400, 0}, {400, 400}, {0, 400}};  // The image's middle is covered.
  projectPoints(points, view, Pose::Identity(), OutsideImage::kIgnore, projected);
  EXPECT_EQ(projected.may_pull, (std::vector<char>{0, 0, 0}));
}

// With weights exp(-d^2/2l^2) taken as constants, the weighted squares majorise -2 l^2 sum exp(-d^2/2l^2): a step that
// lowers the one lowers the other, prior included. That is the paper's claim, section III-C.
TEST(Irls, AStepThatLowersTheWeightedSquaresNeverLowersTheKernelSum) {
  test::Random random(5);
  const XrayCamera camera = test::clinicalCamera();
  const Centerline2d none;
  const XrayViews views{{none, camera}};
  const int n = 30;
  int lowered = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Matrix3Xd points = Eigen::Matrix3Xd::NullaryExpr(3, n, [&] { return 0.03 * random.normal(); });
    Pose T = Pose::Identity();
    T.linear() = expSO3(random.vector(1));
    T.translation() = Eigen::Vector3d(0, 0, 0.75);
    PosePriorTerm prior;
    prior.T0_camera_centered = T * expSE3(random.twist(3e-3, 0.02));
    prior.information.diagonal() << Eigen::Vector3d::Constant(1e7), Eigen::Vector3d::Constant(1e3);
    const double scale = random.uniform(1, 30);
    Pull pull(n);
    const auto distances2 = [&](const Pose& pose) {
      Eigen::ArrayXd d2(n);
      for (int i = 0; i < n; ++i) d2[i] = (*camera.project(pose * points.col(i)) - pull.target_px.col(i)).squaredNorm();
      return d2;
    };
    for (int i = 0; i < n; ++i) {
      const double spread = i % 5 == 0 ? 100 : 10;  // Some matches are wrong.
      pull.target_px.col(i) =
          *camera.project(T * points.col(i)) + Eigen::Vector2d(random.normal(), random.normal()) * spread;
    }
    pull.weight = (-distances2(T) / (2 * scale * scale)).exp();
    const auto step = LevenbergMarquardt().step(points, views, T, {pull}, prior);
    if (!step.lowered) continue;
    ++lowered;
    const auto objective = [&](const Pose& pose) {
      return prior.cost(pose) - 2 * scale * scale * (-distances2(pose) / (2 * scale * scale)).exp().sum();
    };
    const double before = objective(T), after = objective(step.T_camera_centered);
    EXPECT_LE(after, before + 1e-9 * std::abs(before)) << "trial " << trial;
  }
  EXPECT_GT(lowered, 190) << "the property was hardly tried";
}

TEST(LevenbergMarquardt, FindsTheOneMinimumOfExactMatches) {
  test::Random random(6);
  const XrayCamera camera = test::clinicalCamera();
  const Centerline2d none;
  const XrayViews views{{none, camera}};
  const int n = 40;
  const Eigen::Matrix3Xd points = Eigen::Matrix3Xd::NullaryExpr(3, n, [&] { return 0.03 * random.normal(); });
  for (int trial = 0; trial < 10; ++trial) {
    Pose truth = Pose::Identity();
    truth.linear() = expSO3(random.vector(1));
    truth.translation() = Eigen::Vector3d(0, 0, 0.75);
    Pull pull(n);
    pull.weight.setOnes();
    for (int i = 0; i < n; ++i) pull.target_px.col(i) = *camera.project(truth * points.col(i));
    Pose T = truth * expSE3(random.twist(10e-3, 0.1));
    LevenbergMarquardt solver;
    for (int k = 0; k < 20; ++k) T = solver.step(points, views, T, {pull}, PosePriorTerm()).T_camera_centered;
    // The residual is zero at the solution, so convergence is quadratic down to the rounding of pixels, 1e-12 of 0.75
    // m.
    EXPECT_LT(logSE3(truth.inverse() * T).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace angio::test
