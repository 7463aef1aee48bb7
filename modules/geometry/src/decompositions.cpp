// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/decompositions.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace angio::geometry {

Matrix6d inverseOf(const Matrix6d& A) { return A.inverse(); }

Matrix6d inverseOfSymmetric(const Matrix6d& A) { return A.ldlt().solve(Matrix6d::Identity()); }

Eigen::MatrixXd inverseOfSymmetric(const Eigen::MatrixXd& A) {
  return A.ldlt().solve(Eigen::MatrixXd::Identity(A.rows(), A.cols()));
}

Vector6d solveSymmetric(const Matrix6d& A, const Vector6d& b) { return A.ldlt().solve(b); }

Eigen::VectorXd solveSymmetric(const Eigen::MatrixXd& A, const Eigen::VectorXd& b) { return A.ldlt().solve(b); }

double squaredMahalanobis(const Eigen::Vector3d& error, const Eigen::Matrix3d& covariance) {
  return error.dot(covariance.ldlt().solve(error));
}

double squaredMahalanobis(const Vector6d& error, const Matrix6d& covariance) {
  return error.dot(solveSymmetric(covariance, error));
}

double squaredMahalanobis(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance) {
  return error.dot(solveSymmetric(covariance, error));
}

Matrix6d lowerFactorOf(const Matrix6d& A) { return A.llt().matrixL(); }

Eigen::MatrixXd lowerFactorOf(const Eigen::MatrixXd& A) { return A.llt().matrixL(); }

Vector6d eigenvaluesOfSymmetric(const Matrix6d& A) {
  return Eigen::SelfAdjointEigenSolver<Matrix6d>(A, Eigen::EigenvaluesOnly).eigenvalues();
}

SymmetricEigen3 eigenOfSymmetric(const Eigen::Matrix3d& A) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(A);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace angio::geometry
