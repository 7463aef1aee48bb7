// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

#include "angio/calibration/namespace.hpp"

namespace angio::calibration {

// Eigen's decompositions of matrices of any shape, compiled once: each of them costs a source seconds.

/// A = U diag(values) V^T, the largest value first.
struct SingularValues {
  Eigen::VectorXd values;
  Eigen::MatrixXd U, V;  ///< Empty where they were not asked for.
};

/// By Jacobi's method. @param vectors  Eigen's flags of what is wanted beside the values, as Eigen::ComputeFullV.
SingularValues singularValuesOf(const Eigen::MatrixXd& A, unsigned vectors = 0);

/// R of A = Q R by Householder's method: upper triangular, with as many rows as A has columns. A has at least as many.
Eigen::MatrixXd triangularFactor(const Eigen::MatrixXd& A);

/// The x of least |A x - b| for each column b, and the rank of A, by QR with column pivoting.
struct LeastSquares {
  Eigen::MatrixXd solution;
  Eigen::Index rank = 0;
};
LeastSquares leastSquares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& b);

/// L^-1 B with L lower triangular: residuals and their derivatives in standard deviations, where L is the lower factor
/// of their covariance.
Eigen::MatrixXd whitened(const Eigen::MatrixXd& lower, const Eigen::MatrixXd& B);

}  // namespace angio::calibration
