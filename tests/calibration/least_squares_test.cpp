// SPDX-License-Identifier: GPL-2.0-or-later
#include "least_squares.hpp"

#include <gtest/gtest.h>

#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

Eigen::MatrixXd randomMatrix(Random& random, Eigen::Index rows, Eigen::Index columns) {
  Eigen::MatrixXd A(rows, columns);
  for (double& a : A.reshaped()) a = random.normal();
  return A;
}

TEST(LeastSquares, DecompositionsComeBackToTheirMatrix) {
  Random random(7);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::MatrixXd A = randomMatrix(random, 9, 4);
    const SingularValues svd = singularValuesOf(A, Eigen::ComputeThinU | Eigen::ComputeThinV);
    EXPECT_LT((svd.U * svd.values.asDiagonal() * svd.V.transpose() - A).cwiseAbs().maxCoeff(), 1e-13);
    EXPECT_GE(svd.values.minCoeff(), 0);
    EXPECT_GE(svd.values[0], svd.values[3]);
    EXPECT_EQ(singularValuesOf(A).V.size(), 0);
    const Eigen::MatrixXd R = triangularFactor(A);
    EXPECT_TRUE(R.isUpperTriangular(0));
    EXPECT_LT((R.transpose() * R - A.transpose() * A).cwiseAbs().maxCoeff(), 1e-12);
    const Eigen::MatrixXd x = randomMatrix(random, 9, 2);
    EXPECT_LT((R.transpose() * whitened(R.transpose(), x.topRows(4)) - x.topRows(4)).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST(LeastSquares, LeaveAResidualAcrossAllColumns) {
  Random random(8);
  for (int trial = 0; trial < 20; ++trial) {
    Eigen::MatrixXd A = randomMatrix(random, 9, 4);
    const Eigen::MatrixXd b = randomMatrix(random, 9, 2);
    const LeastSquares found = leastSquares(A, b);
    EXPECT_EQ(found.rank, 4);
    EXPECT_LT((A.transpose() * (A * found.solution - b)).cwiseAbs().maxCoeff(), 1e-12);
    A.col(3) = A.col(0) - 2 * A.col(1);
    EXPECT_EQ(leastSquares(A, b).rank, 3);
  }
}

}  // namespace
}  // namespace angio::test
