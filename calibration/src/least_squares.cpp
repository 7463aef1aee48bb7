// SPDX-License-Identifier: GPL-2.0-or-later
#include "least_squares.hpp"

#include <Eigen/QR>
#include <Eigen/SVD>

namespace angio::calibration {

SingularValues singularValuesOf(const Eigen::MatrixXd& A, unsigned vectors) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(A, vectors);
  SingularValues result{svd.singularValues(), {}, {}};
  if (svd.computeU()) result.U = svd.matrixU();
  if (svd.computeV()) result.V = svd.matrixV();
  return result;
}

Eigen::MatrixXd triangularFactor(const Eigen::MatrixXd& A) {
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(A);
  return qr.matrixQR().topRows(A.cols()).triangularView<Eigen::Upper>();
}

LeastSquares leastSquares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& b) {
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(A);
  return {qr.solve(b), qr.rank()};
}

Eigen::MatrixXd whitened(const Eigen::MatrixXd& lower, const Eigen::MatrixXd& B) {
  return lower.triangularView<Eigen::Lower>().solve(B);
}

}  // namespace angio::calibration
