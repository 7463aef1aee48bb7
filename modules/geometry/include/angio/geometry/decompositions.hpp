// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

#include "angio/geometry/se3.hpp"

namespace angio::geometry {

// Eigen's decompositions of the sizes that many sources need, compiled once: each of them costs a source seconds. None
// says whether it succeeded; what comes of a singular or infinite matrix is not finite.

/// A^-1, by LU with partial pivoting.
Matrix6d inverseOf(const Matrix6d& A);

/// A^-1 of a symmetric matrix that is not negative, by LDLT.
Matrix6d inverseOfSymmetric(const Matrix6d& A);
Eigen::MatrixXd inverseOfSymmetric(const Eigen::MatrixXd& A);

/// A^-1 b with a symmetric matrix that is not negative, by LDLT.
Vector6d solveSymmetric(const Matrix6d& A, const Vector6d& b);
Eigen::VectorXd solveSymmetric(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);

/// e^T C^-1 e of an error and its covariance, by LDLT: chi-square of as many degrees of freedom as the error has
/// numbers, where the covariance is right.
double squaredMahalanobis(const Eigen::Vector3d& error, const Eigen::Matrix3d& covariance);
double squaredMahalanobis(const Vector6d& error, const Matrix6d& covariance);
double squaredMahalanobis(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance);

/// Lower triangular L with L L^T = A, of a positive matrix; its lower half is read.
Matrix6d lowerFactorOf(const Matrix6d& A);
Eigen::MatrixXd lowerFactorOf(const Eigen::MatrixXd& A);

/// Eigenvalues of a symmetric matrix, the smallest first; its lower half is read.
Vector6d eigenvaluesOfSymmetric(const Matrix6d& A);

/// Eigenvalues, the smallest first, and the eigenvectors as columns.
struct SymmetricEigen3 {
  Eigen::Vector3d values;
  Eigen::Matrix3d vectors;
};

/// Of a symmetric matrix; its lower half is read.
SymmetricEigen3 eigenOfSymmetric(const Eigen::Matrix3d& A);

}  // namespace angio::geometry
