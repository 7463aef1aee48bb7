// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/se3.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "angio/geometry/so3.hpp"
#include "angio/test/differences.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

// Every law at one rotation angle, the parameter [rad].
struct Se3Laws : testing::TestWithParam<double> {
  // Several directions at one angle; lengths near one.
  std::vector<Twist> samples() const {
    test::Random random(17);
    std::vector<Twist> result;
    for (int i = 0; i < 20; ++i) {
      Twist xi;
      xi << random.vector(1), random.direction() * GetParam();
      result.push_back(xi);
    }
    // Axes of the frame, where entries of the rotation vanish and a branch of the logarithm could divide by them.
    for (int k = 0; k < 3; ++k) {
      Twist xi;
      xi << random.vector(1), Eigen::Vector3d::Unit(k) * GetParam();
      result.push_back(xi);
      xi = -xi;
      result.push_back(xi);
    }
    return result;
  }
};

// A dozen operations on numbers near one each lose an epsilon (2e-16); the series end where what they leave out is
// below it.
constexpr double kRounding = 2e-13;

Eigen::Matrix4d hat(const Twist& xi) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Zero();
  m.topLeftCorner<3, 3>() = skew(xi.tail<3>());
  m.topRightCorner<3, 1>() = xi.head<3>();
  return m;
}

TEST_P(Se3Laws, ExpIsTheMatrixExponential) {
  for (const Twist& xi : samples()) {
    // The series, of a power of two less, squared up again: no term is larger than the first.
    constexpr int kHalvings = 4;
    const Eigen::Matrix4d small = hat(xi) / (1 << kHalvings);
    Eigen::Matrix4d expected = Eigen::Matrix4d::Identity(), term = expected;
    for (int k = 1; k < 25; ++k) {
      term = (term * small / k).eval();
      expected += term;
    }
    for (int k = 0; k < kHalvings; ++k) expected = (expected * expected).eval();
    EXPECT_LT((expSE3(xi).matrix() - expected).cwiseAbs().maxCoeff(), kRounding) << xi.transpose();
    EXPECT_LT(rotationDefect(expSE3(xi).linear()), kRounding);
  }
}

TEST_P(Se3Laws, LogUndoesExp) {
  for (const Twist& xi : samples()) {
    EXPECT_LT((logSE3(expSE3(xi)) - xi).cwiseAbs().maxCoeff(), kRounding) << xi.transpose();
  }
}

TEST_P(Se3Laws, ExpUndoesLog) {
  for (const Twist& xi : samples()) {
    const Pose T = expSE3(xi);
    EXPECT_LT((expSE3(logSE3(T)).matrix() - T.matrix()).cwiseAbs().maxCoeff(), kRounding) << xi.transpose();
  }
}

TEST_P(Se3Laws, TheNegativeTwistIsTheInverse) {
  for (const Twist& xi : samples()) {
    EXPECT_LT(((expSE3(xi) * expSE3(-xi)).matrix() - Eigen::Matrix4d::Identity()).cwiseAbs().maxCoeff(), kRounding);
  }
}

TEST_P(Se3Laws, AdjointCarriesATwistThroughAPose) {
  test::Random random(4);
  for (const Twist& xi : samples()) {
    const Pose T = expSE3(random.twist(1, 1));
    const Pose left = T * expSE3(xi) * T.inverse(), right = expSE3(adjointSE3(T) * xi);
    EXPECT_LT((left.matrix() - right.matrix()).cwiseAbs().maxCoeff(), 10 * kRounding) << xi.transpose();
  }
}

TEST_P(Se3Laws, RightJacobianInverseIsTheDerivativeOfTheLogarithm) {
  for (const Twist& xi : samples()) {
    const auto composed = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd { return logSE3(expSE3(xi) * expSE3(d)); };
    // A step of 1e-5 is off by 1e-10 (third derivatives near one) and by 1e-11 of rounding; beyond pi the logarithm
    // jumps.
    if (GetParam() > kPi - 1e-4) continue;
    const Eigen::MatrixXd numeric = test::centralDifferences(composed, Twist::Zero(), 1e-5);
    EXPECT_LT((rightJacobianInverseSE3(xi) - numeric).cwiseAbs().maxCoeff(), 2e-9) << xi.transpose();
  }
}

// Zero, near zero, both sides of the angle where series replace closed forms, anywhere, and near half a turn.
INSTANTIATE_TEST_SUITE_P(Angles, Se3Laws,
                         testing::Values(0.0, 1e-9, 1e-5, 1e-3, 0.0099999, 0.0100001, 0.1, 1.0, 2.5, kPi - 1e-3,
                                         kPi - 1e-6));

TEST(Rotation, LeftJacobianIsTheDerivativeOfTheTurnedPoint) {
  test::Random random(7);
  for (const double angle : {0.0, 1e-6, 0.01, 0.7, 3.0}) {
    const Eigen::Vector3d w = angle * random.direction(), q(0.3, -1.2, 0.5);
    const Eigen::Matrix3d J = -skew(expSO3(w) * q) * leftJacobianSO3(w);
    for (int j = 0; j < 3; ++j) {
      const Eigen::Vector3d h = 1e-6 * Eigen::Vector3d::Unit(j);
      const Eigen::Vector3d slope = (expSO3(w + h) * q - expSO3(w - h) * q) / 2e-6;
      EXPECT_LT((J.col(j) - slope).norm(), 1e-8) << angle << " " << j;
    }
  }
}

TEST(Rotation, LogarithmAtHalfATurnHasThatAngleAndTurnsTheSame) {
  test::Random random(5);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Matrix3d R = expSO3(kPi * random.direction());
    EXPECT_NEAR(rotationAngle(R), kPi, 1e-12);
    EXPECT_LT((expSO3(logSO3(R)) - R).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST(Rotation, AngleIsAccurateNearZero) {
  test::Random random(6);
  for (const double angle : {1e-12, 1e-9, 1e-6, 1e-3}) {
    EXPECT_NEAR(rotationAngle(expSO3(angle * random.direction())) / angle, 1, 1e-9);
  }
}

TEST(Rotation, SkewIsTheCrossProduct) {
  const Eigen::Vector3d a(1, -2, 3), b(0.5, 4, -1);
  EXPECT_EQ(skew(a) * b, a.cross(b));
}

TEST(Rotation, NearestRotationIsThePolarFactor) {
  test::Random random(7);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Matrix3d R = expSO3(random.vector(1));
    const Eigen::Matrix3d U = expSO3(random.vector(1));
    const Eigen::Vector3d stretch(random.uniform(0.5, 2), random.uniform(0.5, 2), random.uniform(0.5, 2));
    const Eigen::Matrix3d stretched = R * U * stretch.asDiagonal() * U.transpose();
    EXPECT_LT((nearestRotation(stretched) - R).cwiseAbs().maxCoeff(), 1e-13);
    // A reflection has no polar rotation, but the nearest proper one exists all the same.
    EXPECT_LT(rotationDefect(nearestRotation(-stretched)), 1e-13);
  }
}

TEST(Rotation, DefectTellsWhatIsNoRotation) {
  EXPECT_LT(rotationDefect(expSO3({0.1, 2, -1})), 1e-14);
  EXPECT_NEAR(rotationDefect(1.1 * Eigen::Matrix3d::Identity()), 0.21, 1e-12);
  EXPECT_TRUE(std::isinf(rotationDefect(-Eigen::Matrix3d::Identity())));
  EXPECT_TRUE(std::isinf(rotationDefect(Eigen::Matrix3d::Zero())));
  EXPECT_TRUE(std::isinf(rotationDefect(Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN()))));
}

}  // namespace
}  // namespace angio::test
