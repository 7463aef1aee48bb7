// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/direct_linear.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <cmath>

namespace angio::calibration {
namespace {

// The equations leave a second solution open when their second smallest singular value is this small.
constexpr double kOpen = 1e-9;

// Moves points' mean to the origin and their rms distance to sqrt(dimensions).
template <int kRows>
Eigen::Matrix<double, kRows + 1, kRows + 1> normalisation(const Eigen::Matrix<double, kRows, Eigen::Dynamic>& points) {
  const Eigen::Matrix<double, kRows, 1> mean = points.rowwise().mean();
  const double rms = std::sqrt((points.colwise() - mean).squaredNorm() / static_cast<double>(points.cols()));
  const double scale = rms > 0 ? std::sqrt(static_cast<double>(kRows)) / rms : 1;
  Eigen::Matrix<double, kRows + 1, kRows + 1> N = Eigen::Matrix<double, kRows + 1, kRows + 1>::Identity();
  N.template topLeftCorner<kRows, kRows>() *= scale;
  N.template topRightCorner<kRows, 1>() = -scale * mean;
  return N;
}

// The 3 x (kRows + 1) matrix that maps points to pixels, in normalised coordinates; nothing when it is left open.
template <int kRows>
std::optional<Eigen::Matrix<double, 3, kRows + 1>> linearMap(const Eigen::Matrix<double, kRows, Eigen::Dynamic>& points,
                                                             const Eigen::Matrix2Xd& pixels) {
  constexpr int kColumns = kRows + 1, kUnknowns = 3 * kColumns;
  const Eigen::Index count = points.cols();
  if (2 * count < kUnknowns - 1 || pixels.cols() != count) return std::nullopt;
  const auto N_point = normalisation<kRows>(points);
  const auto N_pixel = normalisation<2>(pixels);
  Eigen::Matrix<double, Eigen::Dynamic, kUnknowns> A(2 * count, kUnknowns);
  A.setZero();
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Matrix<double, 1, kColumns> X = (N_point * points.col(i).homogeneous()).transpose();
    const Eigen::Vector3d x = N_pixel * pixels.col(i).homogeneous();
    A.template block<1, kColumns>(2 * i, 0) = X;
    A.template block<1, kColumns>(2 * i, 2 * kColumns) = -x.x() * X;
    A.template block<1, kColumns>(2 * i + 1, kColumns) = X;
    A.template block<1, kColumns>(2 * i + 1, 2 * kColumns) = -x.y() * X;
  }
  // The triangular factor has the same singular vectors; its SVD does not grow with the points.
  const Eigen::Index rows = std::max<Eigen::Index>(2 * count, kUnknowns);
  Eigen::MatrixXd padded = Eigen::MatrixXd::Zero(rows, kUnknowns);
  padded.topRows(2 * count) = A;
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(padded);
  const Eigen::MatrixXd R = qr.matrixQR().topRows(kUnknowns).triangularView<Eigen::Upper>();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(R, Eigen::ComputeFullV);
  if (!(svd.singularValues()[kUnknowns - 2] > kOpen * svd.singularValues()[0])) return std::nullopt;
  const Eigen::VectorXd v = svd.matrixV().col(kUnknowns - 1);
  Eigen::Matrix<double, 3, kColumns> M;
  for (int row = 0; row < 3; ++row) M.row(row) = v.segment<kColumns>(row * kColumns).transpose();
  M = N_pixel.inverse() * M * N_point;
  const Eigen::RowVectorXd depths = M.row(2) * points.colwise().homogeneous();
  if (!(depths.minCoeff() > 0 || depths.maxCoeff() < 0)) return std::nullopt;
  if (depths[0] < 0) M = -M;
  return Eigen::Matrix<double, 3, kColumns>(M / M.norm());
}

// Row of Zhang's equations for B = K^-T K^-1: h_i^T B h_j by B11, B12, B22, B13, B23, B33.
Eigen::Matrix<double, 1, 6> conicRow(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  Eigen::Matrix<double, 1, 6> row;
  row << a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[1] * b[1], a[2] * b[0] + a[0] * b[2], a[2] * b[1] + a[1] * b[2],
      a[2] * b[2];
  return row;
}

}  // namespace

std::optional<Matrix34d> directLinearTransform(const Eigen::Matrix3Xd& points_m, const Eigen::Matrix2Xd& pixels_px) {
  const auto P = linearMap<3>(points_m, pixels_px);
  if (!P) return std::nullopt;
  // A projection has three independent rows of rotation; a degenerate fit has not.
  const Eigen::Matrix3d M = P->leftCols<3>();
  if (!(std::abs(M.determinant()) > 0)) return std::nullopt;
  return P;
}

ProjectionParts decomposed(const Matrix34d& P) {
  Eigen::Matrix3d M = P.leftCols<3>();
  Eigen::Vector3d p4 = P.col(3);
  ProjectionParts parts;
  parts.mirrored = M.determinant() < 0;
  if (parts.mirrored) {
    M.row(0) *= -1;
    p4[0] *= -1;
  }
  // RQ by the QR of the matrix turned round: M = K R.
  Eigen::Matrix3d exchange;
  exchange << 0, 0, 1, 0, 1, 0, 1, 0, 0;
  const Eigen::HouseholderQR<Eigen::Matrix3d> qr((exchange * M).transpose());
  Eigen::Matrix3d upper = qr.matrixQR().triangularView<Eigen::Upper>();
  const Eigen::Matrix3d Q = qr.householderQ();
  Eigen::Matrix3d K = exchange * upper.transpose() * exchange;
  Eigen::Matrix3d R = exchange * Q.transpose();
  for (int i = 0; i < 3; ++i) {
    if (K(i, i) >= 0) continue;
    K.col(i) *= -1;
    R.row(i) *= -1;
  }
  parts.T_camera_model = Pose::Identity();
  parts.T_camera_model.linear() = nearestRotation(R);
  parts.T_camera_model.translation() = K.triangularView<Eigen::Upper>().solve(p4);
  parts.K = K / K(2, 2);
  return parts;
}

Eigen::Matrix2Xd projectedBy(const Matrix34d& P, const Eigen::Matrix3Xd& points_m) {
  return (P * points_m.colwise().homogeneous()).colwise().hnormalized();
}

std::optional<Eigen::Matrix3d> directLinearHomography(const Eigen::Matrix2Xd& plane_m,
                                                      const Eigen::Matrix2Xd& pixels_px) {
  return linearMap<2>(plane_m, pixels_px);
}

std::optional<Eigen::Matrix3d> planarIntrinsics(const std::vector<Eigen::Matrix3d>& homographies,
                                                const Eigen::Vector2d& middle_px, PlanarAssumption assumption) {
  // About the middle and in units of its distance all numbers are near one.
  const double unit_px = middle_px.norm();
  Eigen::Matrix3d N = Eigen::Matrix3d::Identity();
  N.topLeftCorner<2, 2>() /= unit_px;
  N.topRightCorner<2, 1>() = -middle_px / unit_px;
  std::vector<int> free = {0, 1, 2, 3, 4, 5};
  if (assumption == PlanarAssumption::kNoSkew) free = {0, 2, 3, 4, 5};
  if (assumption == PlanarAssumption::kCentered) free = {0, 2, 5};
  const auto unknowns = static_cast<Eigen::Index>(free.size());
  if (2 * static_cast<Eigen::Index>(homographies.size()) < unknowns - 1) return std::nullopt;
  Eigen::MatrixXd V = Eigen::MatrixXd::Zero(std::max<Eigen::Index>(2 * homographies.size(), unknowns), unknowns);
  for (std::size_t v = 0; v < homographies.size(); ++v) {
    Eigen::Matrix3d H = N * homographies[v];
    H /= std::sqrt(H.col(0).norm() * H.col(1).norm());
    const Eigen::Matrix<double, 1, 6> right_angle = conicRow(H.col(0), H.col(1)),
                                      one_length = conicRow(H.col(0), H.col(0)) - conicRow(H.col(1), H.col(1));
    for (Eigen::Index k = 0; k < unknowns; ++k) {
      V(2 * static_cast<Eigen::Index>(v), k) = right_angle[free[static_cast<std::size_t>(k)]];
      V(2 * static_cast<Eigen::Index>(v) + 1, k) = one_length[free[static_cast<std::size_t>(k)]];
    }
  }
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(V, Eigen::ComputeFullV);
  if (!(svd.singularValues()[unknowns - 2] > kOpen * svd.singularValues()[0])) return std::nullopt;
  Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
  for (Eigen::Index k = 0; k < unknowns; ++k) b[free[static_cast<std::size_t>(k)]] = svd.matrixV()(k, unknowns - 1);
  if (b[0] < 0) b = -b;
  Eigen::Matrix3d B;
  B << b[0], b[1], b[3], b[1], b[2], b[4], b[3], b[4], b[5];
  // B ~ K^-T K^-1: its Cholesky factor is K^-T, up to scale.
  const Eigen::LLT<Eigen::Matrix3d> factor(B);
  if (factor.info() != Eigen::Success) return std::nullopt;
  Eigen::Matrix3d K = N.inverse() * Eigen::Matrix3d(factor.matrixL()).transpose().inverse();
  K /= K(2, 2);
  if (!K.allFinite()) return std::nullopt;
  return K;
}

Pose planarPose(const Eigen::Matrix3d& homography, const Eigen::Matrix3d& K) {
  const Eigen::Matrix3d columns = K.inverse() * homography;
  const double scale = 2 / (columns.col(0).norm() + columns.col(1).norm());
  Eigen::Matrix3d R;
  R << scale * columns.col(0), scale * columns.col(1), Eigen::Vector3d::Zero();
  R.col(2) = R.col(0).cross(R.col(1));
  Pose T = Pose::Identity();
  T.linear() = nearestRotation(R);
  T.translation() = scale * columns.col(2);
  return T;
}

}  // namespace angio::calibration
