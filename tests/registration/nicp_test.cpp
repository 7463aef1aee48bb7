// SPDX-License-Identifier: GPL-2.0-or-later
#include <ceres/autodiff_cost_function.h>
#include <ceres/rotation.h>
#include <gtest/gtest.h>

#include <cmath>

#include "angio/geometry/decompositions.hpp"
#include "angio/registration/registration.hpp"
#include "angio/test/differences.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"
#include "ridge_step.hpp"

namespace angio::test {
namespace {

RidgeImage::Samples randomSamples(test::Random& random, int rows, int columns) {
  RidgeImage::Samples samples(rows, columns);
  for (Eigen::Index k = 0; k < samples.size(); ++k) samples.data()[k] = static_cast<float>(random.uniform(0, 1));
  return samples;
}

// A small detector, two views of it, some points before them, and images of which nothing is known.
struct RidgeScene {
  static constexpr double kStride_px = 4, kScale_px = 11;

  test::Random random{3};
  XrayCamera camera = XrayCamera::centered(128, 96, 1e-3, 1.2);
  Centerline2d none;
  XrayViews views{{none, camera}, {none, camera}};
  std::vector<RidgeImage::Samples> samples{randomSamples(random, 24, 32), randomSamples(random, 24, 32)};
  RidgeImage first{samples[0], kStride_px, kScale_px}, second{samples[1], kStride_px, kScale_px};
  std::vector<const RidgeImage*> images{&first, &second};
  WeightedPoints points{Eigen::Matrix3Xd(3, 25), Eigen::ArrayXd(25)};
  Pose T = Pose::Identity();

  RidgeScene() {
    for (int i = 0; i < 25; ++i) {
      points.centered.col(i) = random.vector(0.012);
      points.weight[i] = random.uniform(0.5, 1.5);
    }
    T.linear() = expSO3(random.vector(1));
    T.translation() = Eigen::Vector3d(2e-3, -1e-3, 0.75);
    views[1].T_view_first = expSE3(random.twist(1e-3, 0.02));
  }
};

// The same cost as a sum over all coefficients of the centred basis function, for automatic differentiation. It holds
// to first order in xi, for points that all views see.
struct RidgeTwin {
  const RidgeScene& scene;

  template <typename T>
  static T basis(const T& offset) {
    const T d = offset < T(0) ? -offset : offset;
    if (d >= T(2)) return T(0);
    if (d >= T(1)) return (T(2) - d) * (T(2) - d) * (T(2) - d) / T(6);
    return T(2.0 / 3) - d * d + d * d * d / T(2);
  }

  template <typename T>
  bool operator()(const T* xi, T* residual) const {
    const auto& c = scene.camera.parameters();
    residual[0] = T(0);
    for (std::size_t v = 0; v < scene.views.size(); ++v) {
      const Pose T_view = scene.views[v].T_view_first * scene.T;
      for (Eigen::Index i = 0; i < scene.points.centered.cols(); ++i) {
        const Eigen::Matrix<T, 3, 1> p = scene.points.centered.col(i).cast<T>();
        Eigen::Matrix<T, 3, 1> turned;
        ceres::AngleAxisRotatePoint(xi + 3, p.data(), turned.data());
        turned += Eigen::Map<const Eigen::Matrix<T, 3, 1>>(xi);
        const Eigen::Matrix<T, 3, 1> q = T_view.linear().cast<T>() * turned + T_view.translation().cast<T>();
        const T column = (c.fx_px * q.x() / q.z() + c.cx_px) / RidgeScene::kStride_px;
        const T row = (c.fy_px * q.y() / q.z() + c.cy_px) / RidgeScene::kStride_px;
        const RidgeImage::Samples& samples = scene.samples[v];
        T value(0);
        for (int y = 0; y < samples.rows(); ++y) {
          for (int x = 0; x < samples.cols(); ++x) {
            value += T(double{samples(y, x)}) * basis(T(column - double(x))) * basis(T(row - double(y)));
          }
        }
        const double variance_px2 = RidgeScene::kScale_px * RidgeScene::kScale_px;
        residual[0] += 2 * variance_px2 * scene.points.weight[i] * (T(1) - value);
      }
    }
    return true;
  }
};

TEST(RidgeImage, DerivativesAreThoseOfItsValue) {
  RidgeScene s;
  const auto value = [&](const Eigen::VectorXd& at) {
    return Eigen::VectorXd::Constant(1, s.first.valueAt(at.head<2>()));
  };
  const auto gradient = [&](const Eigen::VectorXd& at) { return Eigen::VectorXd(s.first.read(at.head<2>()).gradient); };
  for (int trial = 0; trial < 200; ++trial) {
    // Up to the detector's edges, where the spline has lost neighbours.
    const Eigen::Vector2d at(s.random.uniform(-0.5, 127.5), s.random.uniform(-0.5, 95.5));
    const RidgeImage::Reading reading = s.first.read(at);
    EXPECT_NEAR(reading.value, s.first.valueAt(at), 1e-14);
    // Values of 1 to 1e-16 over steps of 1e-5: 1e-11, and third derivatives jump by 1/4^3 at knots: 1e-7 in curvature.
    EXPECT_LT((centralDifferences(value, at, 1e-5).transpose() - reading.gradient).norm(), 1e-9);
    EXPECT_LT((centralDifferences(gradient, at, 1e-5) - reading.hessian).norm(), 1e-6);
  }
}

TEST(RidgeImage, ALineIsAGaussianOfItsScaleAcross) {
  const XrayCamera camera = test::clinicalCamera();
  const std::vector<double> scales_px{32, 16, 8, 4, 2, 1};
  for (const double angle_rad : {0.0, 0.3, kPi / 4}) {
    const Eigen::Vector2d along(std::cos(angle_rad), std::sin(angle_rad)), across(-along.y(), along.x());
    const Eigen::Vector2d middle(511.3, 509.8);
    Eigen::Matrix2Xd points(2, 401);
    for (int j = 0; j < 401; ++j) points.col(j) = middle + (j - 200) * 2 * along;
    // Twice over, as two vessels one behind the other: what is drawn is where there is a line.
    Eigen::Matrix2Xd twice(2, 802);
    twice << points, points;
    std::vector<int> branch(802, 0);
    std::fill(branch.begin() + 401, branch.end(), 1);
    const auto images = ridgeImages(makeCenterline(twice, branch), 3, camera, scales_px);
    ASSERT_EQ(images.size(), scales_px.size());
    for (std::size_t s = 0; s < images.size(); ++s) {
      EXPECT_EQ(images[s].scale_px(), scales_px[s]);
      for (const double offset : {0.0, 0.5, 1.0, 2.0}) {
        const double value = images[s].valueAt(middle + offset * scales_px[s] * across + 0.37 * along);
        // What drawing and a kernel of finite length leave. At 1 px the kernel has five taps, and its variance of 0.3
        // px^2 is off by 0.02.
        const double tolerance = scales_px[s] < 2 ? 0.04 : 0.02;
        EXPECT_NEAR(value, std::exp(-0.5 * offset * offset), tolerance)
            << scales_px[s] << " px, " << angle_rad << " rad";
      }
    }
  }
}

TEST(RidgeEquations, GradientAgreesThreeWays) {
  RidgeScene s;
  const PosePriorTerm none;
  const RidgeEquations n = ridgeEquations(s.points, s.views, s.images, s.T, none);
  EXPECT_NEAR(n.cost_px2, ridgeCost(s.points, s.views, s.images, s.T, none), 1e-9 * n.cost_px2);

  const ceres::AutoDiffCostFunction<RidgeTwin, 1, 6> twin(new RidgeTwin{s});
  const Vector6d zero = Vector6d::Zero();
  const double* parameters = zero.data();
  Vector6d automatic;
  double* J = automatic.data();
  double cost = 0;
  ASSERT_TRUE(twin.Evaluate(&parameters, &cost, &J));
  EXPECT_NEAR(n.cost_px2, cost, 1e-9 * cost);
  EXPECT_LT((2 * n.g - automatic).norm(), 1e-9 * automatic.norm());

  // With a prior, whose centre is elsewhere.
  PosePriorTerm prior;
  prior.T0_camera_centered = s.T * expSE3(s.random.twist(2e-3, 0.05));
  prior.information.diagonal() << Eigen::Vector3d::Constant(1e7), Eigen::Vector3d::Constant(1e5);
  const auto costAt = [&](const Eigen::VectorXd& dx) {
    return Eigen::VectorXd::Constant(1, ridgeCost(s.points, s.views, s.images, s.T * expSE3(dx), prior));
  };
  const Vector6d with_prior = 2 * ridgeEquations(s.points, s.views, s.images, s.T, prior).g;
  // Third derivatives times the square of a step that moves points by a thousandth of a stride.
  const Eigen::VectorXd numeric = centralDifferences(costAt, zero, 1e-7).transpose();
  EXPECT_LT((with_prior - numeric).norm(), 1e-5 * numeric.norm());
}

TEST(RidgeEquations, WhatIsNotSeenPullsNowhereAndCostsInFull) {
  RidgeScene s;
  const PosePriorTerm none;
  Pose beside = s.T, behind = s.T;
  beside.translation().x() += 1;
  behind.translation().z() -= 2;
  for (const Pose& T : {beside, behind}) {
    const RidgeEquations n = ridgeEquations(s.points, s.views, s.images, T, none);
    EXPECT_EQ(ridgeMetric(s.points, s.views, s.images, T), 0);
    EXPECT_TRUE(n.g.isZero(0));
    EXPECT_NEAR(n.cost_px2, 2 * 2 * RidgeScene::kScale_px * RidgeScene::kScale_px * s.points.weight.sum(), 1e-9);
  }
}

// The tree's own image, blurred, and starts that are off.
struct AscentScene {
  VesselTree tree = test::branchingTree(2);
  XrayCamera camera = test::clinicalCamera();
  test::Random random{11};
  Pose truth = test::viewOf(tree, random);
  Centerline2d image = projectedCenterline(tree, camera, truth);
  XrayViews views{{image, camera}};
  std::vector<RidgeImage> blurred = ridgeImages(densified(image, 2), 2, camera, {16, 4, 1});
  WeightedPoints points = weightedPoints(tree);

  Pose start(double translation_m, double rotation_rad) {
    return truth * Eigen::Translation3d(tree.centroid()) * expSE3(random.twist(translation_m, rotation_rad));
  }
};

TEST(RidgeAscent, TheMetricNeverFalls) {
  AscentScene s;
  const PosePriorTerm none;
  int rose = 0;
  for (int trial = 0; trial < 12; ++trial) {
    Pose T = s.start(6e-3, degToRad(3));
    const std::vector<const RidgeImage*> image{&s.blurred[static_cast<std::size_t>(trial) % 3]};
    const auto freedom = trial % 2 == 0 ? RidgeFreedom::kAll : RidgeFreedom::kInPlane;
    RidgeAscent solver;
    double metric = ridgeMetric(s.points, s.views, image, T);
    const double depth_m = T.translation().z();
    for (int k = 0; k < 12; ++k) {
      T = solver.step(s.points, s.views, image, T, none, freedom).T_camera_centered;
      const double now = ridgeMetric(s.points, s.views, image, T);
      EXPECT_GE(now, metric - 1e-12) << trial << ", step " << k;
      rose += now > metric ? 1 : 0;
      metric = now;
    }
    if (freedom == RidgeFreedom::kInPlane) {
      // A twist across the axis and about it leaves depth as it is.
      EXPECT_NEAR(T.translation().z(), depth_m, 1e-9);
    }
  }
  EXPECT_GT(rose, 60) << "the property was hardly tried";
}

TEST(RidgeAscent, AStepDoesNotDependOnTheModelsFrame) {
  AscentScene s;
  const PosePriorTerm none;
  Pose G = Pose::Identity();
  G.linear() = expSO3(s.random.vector(1));
  WeightedPoints turned = s.points;
  turned.centered = G.linear() * s.points.centered;
  for (const auto freedom : {RidgeFreedom::kAll, RidgeFreedom::kInPlane}) {
    const Pose T = s.start(3e-3, degToRad(1));
    const std::vector<const RidgeImage*> image{&s.blurred[1]};
    const auto a = RidgeAscent().step(s.points, s.views, image, T, none, freedom);
    const auto b = RidgeAscent().step(turned, s.views, image, T * G.inverse(), none, freedom);
    ASSERT_TRUE(a.lowered && b.lowered);
    const Pose same = b.T_camera_centered * G;
    EXPECT_LT((a.T_camera_centered.matrix() - same.matrix()).cwiseAbs().maxCoeff(), 1e-10);
  }
}

TEST(WeightedPoints, ThickTubesCountTwiceAsMuchAsThinOnes) {
  Eigen::Matrix3Xd line(3, 4);
  line << 0, 1e-3, 2e-3, 3e-3, 0, 0, 0, 0, 0, 0, 0, 0;
  const WeightedPoints points = weightedPoints(VesselTree(line, {-1, 0, 1, 2}, {1e-9, 20e-3, std::nullopt, 0.5e-3}));
  EXPECT_NEAR(points.weight.mean(), 1, 1e-14);
  EXPECT_NEAR(points.weight[1] / points.weight[0], 2, 1e-5);
  EXPECT_NEAR(points.weight[2] / points.weight[0], 1, 1e-5);
  EXPECT_NEAR(points.weight[3] / points.weight[0], 2 / (1 + std::exp(-1.0)), 1e-5);
}

// Mean distance of the tree's projection from where the truth puts it [px].
double meanOff_px(const AscentScene& s, const Pose& T_camera_model) {
  double sum = 0;
  for (int i = 0; i < s.tree.size(); ++i) {
    const Eigen::Vector3d p = s.tree.points().col(i);
    sum += (*s.camera.project(T_camera_model * p) - *s.camera.project(s.truth * p)).norm();
  }
  return sum / s.tree.size();
}

// The line fills corners where vessels meet and cross, which draws a fit of 1 px of blur by hundredths of a pixel. At
// 32 px the metric is larger for a tree that has receded; what is there is not lost by looking so coarsely first.
TEST(Nicp, StaysAtTheTruthAndComesBackFromBesideIt) {
  AscentScene s;
  const auto registration = makeRegistration(NicpSettings(), s.tree);
  const auto at_truth = registration->align(s.image, s.camera, {s.truth, {}});
  EXPECT_EQ(at_truth.status, RegistrationStatus::kConverged) << at_truth.reason;
  EXPECT_EQ(at_truth.prior, PriorInForce::kNone);
  EXPECT_LT(meanOff_px(s, at_truth.T_camera_model), 0.1);
  for (int trial = 0; trial < 5; ++trial) {
    Twist off;
    off << 1e-3 * s.random.direction(), degToRad(0.5) * s.random.direction();
    const auto easy = registration->align(s.image, s.camera, {test::perturbed(s.truth, s.tree, off), {}});
    EXPECT_EQ(easy.status, RegistrationStatus::kConverged) << easy.reason;
    EXPECT_LT(meanOff_px(s, easy.T_camera_model), 0.1);
    EXPECT_NEAR((easy.T_camera_model * s.tree.centroid()).z(), (s.truth * s.tree.centroid()).z(), 0.5e-3);
  }
}

TEST(Nicp, ACovarianceThatComesWithTheStartHoldsIt) {
  AscentScene s;
  Twist off;
  off << 1e-3 * s.random.direction(), degToRad(0.5) * s.random.direction();
  PosePrior prior{test::perturbed(s.truth, s.tree, off), Matrix6d(1e-14 * Matrix6d::Identity())};
  const auto held = makeRegistration(NicpSettings(), s.tree)->align(s.image, s.camera, prior);
  EXPECT_EQ(held.prior, PriorInForce::kGivenCovariance);
  // Known to 0.1 um and urad, it moves by no more than the image can pull: 1e3 points of 1 px against 1e14.
  EXPECT_LT((held.T_camera_model.matrix() - prior.T_camera_model.matrix()).cwiseAbs().maxCoeff(), 1e-5);
}

}  // namespace
}  // namespace angio::test
