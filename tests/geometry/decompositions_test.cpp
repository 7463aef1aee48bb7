// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/decompositions.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

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

TEST(Decompositions, ComeBackToTheirMatrix) {
  Random random(7);
  for (int trial = 0; trial < 20; ++trial) {
    Eigen::MatrixXd A(9, 4);
    for (double& a : A.reshaped()) a = random.normal();
    const SingularValues svd = singularValuesOf(A, Eigen::ComputeThinU | Eigen::ComputeThinV);
    EXPECT_LT((svd.U * svd.values.asDiagonal() * svd.V.transpose() - A).cwiseAbs().maxCoeff(), 1e-13);
    EXPECT_GE(svd.values.minCoeff(), 0);
    EXPECT_GE(svd.values[0], svd.values[3]);
    EXPECT_EQ(singularValuesOf(A).V.size(), 0);
    const Eigen::MatrixXd R = triangularFactor(A);
    EXPECT_TRUE(R.isUpperTriangular(0));
    EXPECT_LT((R.transpose() * R - A.transpose() * A).cwiseAbs().maxCoeff(), 1e-12);
    const Eigen::Matrix3d S = A.topLeftCorner<3, 3>().transpose() * A.topLeftCorner<3, 3>();
    const SymmetricEigen3 eigen = eigenOfSymmetric(S);
    EXPECT_LT((eigen.vectors * eigen.values.asDiagonal() * eigen.vectors.transpose() - S).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_LE(eigen.values[0], eigen.values[2]);
  }
}

// Loops answer with the same commands, bit for bit, wherever a decomposition is compiled.
TEST(Decompositions, GiveEigensOwnBits) {
  for (unsigned seed = 1; seed < 20; ++seed) {
    const Matrix6d A = information(seed);
    const Vector6d b = Random(seed + 100).twist(1, 1);
    EXPECT_EQ(inverseOf(A), Matrix6d(A.inverse()));
    EXPECT_EQ(solveSymmetric(A, b), Vector6d(A.ldlt().solve(b)));
    EXPECT_EQ(squaredMahalanobis(b, A), b.dot(A.ldlt().solve(b)));
    EXPECT_EQ(lowerFactorOf(A), Matrix6d(A.llt().matrixL()));
    const Eigen::Vector3d b3 = b.head<3>();
    const Eigen::Matrix3d A3 = A.topLeftCorner<3, 3>();
    EXPECT_EQ(squaredMahalanobis(b3, A3), b3.dot(A3.ldlt().solve(b3)));
    EXPECT_EQ(inverseOfSymmetric(A), Matrix6d(A.ldlt().solve(Matrix6d::Identity())));
    EXPECT_EQ(eigenvaluesOfSymmetric(A), Eigen::SelfAdjointEigenSolver<Matrix6d>(A).eigenvalues());
    const Eigen::MatrixXd any = A;
    EXPECT_EQ(lowerFactorOf(any), Eigen::MatrixXd(any.llt().matrixL()));
    const Eigen::VectorXd right = b;
    EXPECT_EQ(solveSymmetric(any, right), Eigen::VectorXd(any.ldlt().solve(right)));
    EXPECT_EQ(squaredMahalanobis(right, any), right.dot(any.ldlt().solve(right)));
  }
}

TEST(Decompositions, AnInformationWithoutContentHasNoFiniteInverse) {
  EXPECT_FALSE(inverseOf(Matrix6d::Zero()).allFinite());
}

}  // namespace
}  // namespace angio::test
