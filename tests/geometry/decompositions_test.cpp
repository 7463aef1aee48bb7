// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/decompositions.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/random.hpp"

namespace angio::test {
namespace {

// Symmetric and positive, as information of a pose is: metres beside radians.
Matrix6d information(unsigned seed) {
  Random random(seed);
  Matrix6d J;
  for (int k = 0; k < 6; ++k) J.col(k) = random.twist(100, 1);
  return J.transpose() * J + Matrix6d::Identity();
}

TEST(Decompositions, AnInverseTimesItsMatrixIsOne) {
  for (unsigned seed = 1; seed < 20; ++seed) {
    const Matrix6d A = information(seed);
    // Its condition is at most 1e6 or so: ten digits are left.
    EXPECT_LT((A * inverseOf(A) - Matrix6d::Identity()).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_LT((A * inverseOfSymmetric(A) - Matrix6d::Identity()).cwiseAbs().maxCoeff(), 1e-9);
    const Eigen::MatrixXd any = A;
    EXPECT_LT((any * inverseOfSymmetric(any) - Eigen::MatrixXd::Identity(6, 6)).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(Decompositions, ASolutionTimesItsMatrixIsTheRightHandSide) {
  for (unsigned seed = 1; seed < 20; ++seed) {
    const Matrix6d A = information(seed);
    const Vector6d b = Random(seed + 100).twist(1, 1);
    const Eigen::MatrixXd any = A;
    const Eigen::VectorXd right = b;
    const Vector6d x = solveSymmetric(A, b);
    EXPECT_LT((A * x - b).norm(), 1e-9);
    EXPECT_LT((any * solveSymmetric(any, right) - right).norm(), 1e-9);
    EXPECT_NEAR(squaredMahalanobis(b, A), b.dot(x), 1e-12);
    EXPECT_NEAR(squaredMahalanobis(right, any), b.dot(x), 1e-12);
    const Eigen::Matrix3d A3 = A.topLeftCorner<3, 3>();
    const Eigen::Vector3d x3 = b.head<3>();
    EXPECT_NEAR(squaredMahalanobis(Eigen::Vector3d(A3 * x3), A3), x3.dot(A3 * x3), 1e-9 * A3.norm());
  }
}

TEST(Decompositions, FactorsAndEigenvaluesComeBackToTheirMatrix) {
  for (unsigned seed = 1; seed < 20; ++seed) {
    const Matrix6d A = information(seed);
    const Matrix6d L = lowerFactorOf(A);
    const double rounding = 1e-13 * A.norm();
    EXPECT_TRUE(L.isLowerTriangular(0));
    EXPECT_LT((L * L.transpose() - A).norm(), rounding);
    EXPECT_LT((lowerFactorOf(Eigen::MatrixXd(A)) - L).norm(), rounding);
    const Vector6d values = eigenvaluesOfSymmetric(A);
    EXPECT_NEAR(values.sum(), A.trace(), rounding);
    EXPECT_NEAR(values.squaredNorm(), A.squaredNorm(), rounding * A.norm());
    for (int k = 0; k < 5; ++k) EXPECT_LE(values[k], values[k + 1]);
    const Eigen::Matrix3d A3 = A.topLeftCorner<3, 3>();
    const SymmetricEigen3 eigen = eigenOfSymmetric(A3);
    EXPECT_LT((eigen.vectors * eigen.values.asDiagonal() * eigen.vectors.transpose() - A3).norm(), rounding);
    EXPECT_LE(eigen.values[0], eigen.values[2]);
  }
}

TEST(Decompositions, AnInformationWithoutContentHasNoFiniteInverse) {
  EXPECT_FALSE(inverseOf(Matrix6d::Zero()).allFinite());
}

}  // namespace
}  // namespace angio::test
