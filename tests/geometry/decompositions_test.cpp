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

// Loops answer with the same commands, bit for bit, wherever a decomposition is compiled.
TEST(Decompositions, GiveEigensOwnBits) {
  for (unsigned seed = 1; seed < 20; ++seed) {
    const Matrix6d A = information(seed);
    const Vector6d b = Random(seed + 100).twist(1, 1);
    EXPECT_EQ(inverseOf(A), Matrix6d(A.inverse()));
    EXPECT_EQ(solveSymmetric(A, b), Vector6d(A.ldlt().solve(b)));
    EXPECT_EQ(inverseOfSymmetric(A), Matrix6d(A.ldlt().solve(Matrix6d::Identity())));
    EXPECT_EQ(eigenvaluesOfSymmetric(A), Eigen::SelfAdjointEigenSolver<Matrix6d>(A).eigenvalues());
    const Eigen::MatrixXd any = A;
    const Eigen::VectorXd right = b;
    EXPECT_EQ(solveSymmetric(any, right), Eigen::VectorXd(any.ldlt().solve(right)));
  }
}

TEST(Decompositions, AnInformationWithoutContentHasNoFiniteInverse) {
  EXPECT_FALSE(inverseOf(Matrix6d::Zero()).allFinite());
}

}  // namespace
}  // namespace angio::test
