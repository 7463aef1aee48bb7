// SPDX-License-Identifier: GPL-2.0-or-later
#include "model_error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "angio/geometry/decompositions.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

using registration::ModelError;
using registration::ResidualGroup;

constexpr double kLength_m = 60e-3, kFocal_px = 3880, kDepth_m = 0.8, kNoise_px = 1;
constexpr int kPoints = 60;  // Of a group.

// Groups of residuals of a rigid fit to a tree 100 mm wide, drawn from the model itself: a deformation of which the
// smooth part is `deformation_m`, and a linear part of like size beside it.
struct Drawn {
  std::vector<ResidualGroup> groups;
  Matrix6d information = Matrix6d::Zero();
  double currency = 1 / (kNoise_px * kNoise_px);
  Eigen::Vector3d at = Eigen::Vector3d::Zero(), error_m = Eigen::Vector3d::Zero();  // Of one more point of the tree.
};

Drawn draw(test::Random& random, double deformation_m, int count = 60) {
  Drawn drawn;
  const int n = count + 1;
  Eigen::Matrix3Xd places(3, n);
  for (int i = 0; i < n; ++i) places.col(i) = 0.05 * random.vector(1).cwiseMax(-1).cwiseMin(1);
  Eigen::MatrixXd K(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const double d = (places.col(i) - places.col(j)).norm() / kLength_m;
      K(i, j) = (1 + d + d * d / 3) * std::exp(-d) + (i == j ? 1e-9 : 0);
    }
  }
  const Eigen::MatrixXd root = lowerFactorOf(K);
  const double radius_m = std::sqrt(places.colwise().squaredNorm().mean());
  Eigen::MatrixXd field(3, n);
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::VectorXd white(n);
    for (int i = 0; i < n; ++i) white[i] = random.normal();
    field.row(axis) = deformation_m * (root * white).transpose();
  }
  Eigen::Matrix3d strain;
  for (int k = 0; k < 9; ++k) strain(k / 3, k % 3) = random.normal();
  field += deformation_m / radius_m * strain * places;

  Vector6d right = Vector6d::Zero();
  for (int i = 0; i < count; ++i) {
    ResidualGroup group;
    const double angle = random.uniform(0, kPi);
    group.at = places.col(i);
    // Across the vessel, seen along z by a camera with perspective.
    const double z = kDepth_m + group.at.z();
    group.gradient = kFocal_px / z * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
    group.gradient.z() = -group.gradient.head<2>().dot(group.at.head<2>()) / z;
    group.jacobian << group.gradient, group.at.cross(group.gradient);
    group.weight = group.pull = kPoints;
    group.scatter_px2 = kNoise_px * kNoise_px;
    group.residual_px =
        -group.gradient.dot(field.col(i)) + kNoise_px / std::sqrt(static_cast<double>(kPoints)) * random.normal();
    drawn.information += drawn.currency * kPoints * group.jacobian * group.jacobian.transpose();
    right -= drawn.currency * kPoints * group.jacobian * group.residual_px;
    drawn.groups.push_back(group);
  }
  const Vector6d moved = solveSymmetric(drawn.information, right);  // The rigid fit.
  for (ResidualGroup& group : drawn.groups) group.residual_px += group.jacobian.dot(moved);
  drawn.at = places.col(count);
  drawn.error_m = moved.head<3>() + moved.tail<3>().cross(drawn.at) - field.col(count);
  return drawn;
}

// Of a point that lies off by a normal error of the claimed covariance, 99.7 % lie within 3 standard deviations (14.16
// for three axes); the claim is wider than normal on purpose, by 1.5, and a mean of three squares is 3 / 1.5^2 = 1.3.
// What the amplitude's uncertainty adds keeps it below 3.
TEST(ModelError, ClaimsHoldForDeformationsOfEverySize) {
  test::Random random(17);
  for (const double deformation_m : {0.1e-3, 0.4e-3, 1.5e-3}) {
    constexpr int kTrials = 120;
    double squares = 0;
    int beyond = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
      const Drawn drawn = draw(random, deformation_m);
      const ModelError error(drawn.groups, drawn.information, drawn.currency, kLength_m);
      const double squared = squaredMahalanobis(drawn.error_m, error.pointCovariance(drawn.at));
      squares += squared;
      beyond += squared > 14.16;
    }
    EXPECT_LE(beyond, 2) << deformation_m;
    EXPECT_LT(squares / kTrials, 3) << deformation_m;
    EXPECT_GT(squares / kTrials, 0.3) << deformation_m << ": far too wide";
  }
}

TEST(ModelError, TheAmplitudeFollowsTheDeformation) {
  test::Random random(23);
  for (const double deformation_m : {0.2e-3, 0.8e-3, 3e-3}) {
    std::vector<double> found;
    for (int trial = 0; trial < 21; ++trial) {
      const Drawn drawn = draw(random, deformation_m);
      found.push_back(ModelError(drawn.groups, drawn.information, drawn.currency, kLength_m).amplitude_m());
    }
    std::nth_element(found.begin(), found.begin() + 10, found.end());
    EXPECT_GT(found[10], 0.6 * deformation_m);
    EXPECT_LT(found[10], 2.5 * deformation_m);
  }
}

// A rigid tree keeps its depth: what is claimed stays below the 3 mm that a converged fit may leave open.
TEST(ModelError, ARigidTreeIsNotCalledDeformed) {
  test::Random random(29);
  for (int trial = 0; trial < 20; ++trial) {
    const Drawn drawn = draw(random, 0);
    const ModelError error(drawn.groups, drawn.information, drawn.currency, kLength_m);
    EXPECT_LT(error.amplitude_m(), 0.1e-3);
    EXPECT_LT(std::sqrt(error.pointCovariance({0, 0, 0})(2, 2)), 3e-3);
  }
}

// What few observations cannot tell is not claimed, and not invented.
TEST(ModelError, FewGroupsSayNothing) {
  test::Random random(31);
  const Drawn drawn = draw(random, 1e-3, 11);
  const ModelError error(drawn.groups, drawn.information, drawn.currency, kLength_m);
  EXPECT_EQ(error.amplitude_m(), 0);
  const Eigen::Vector3d at(0.01, 0, 0);
  EXPECT_TRUE(error.pointCovariance(at).isApprox(error.pointNoise(at)));
}

}  // namespace
}  // namespace angio::test
