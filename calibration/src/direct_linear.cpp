// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/direct_linear.hpp"

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include "least_squares.hpp"

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
  // The triangular factor has the same singular vectors; its SVD does not grow with the points.
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(std::max<Eigen::Index>(2 * count, kUnknowns), kUnknowns);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Matrix<double, 1, kColumns> X = (N_point * points.col(i).homogeneous()).transpose();
    const Eigen::Vector3d x = N_pixel * pixels.col(i).homogeneous();
    A.block<1, kColumns>(2 * i, 0) = X;
    A.block<1, kColumns>(2 * i, 2 * kColumns) = -x.x() * X;
    A.block<1, kColumns>(2 * i + 1, kColumns) = X;
    A.block<1, kColumns>(2 * i + 1, 2 * kColumns) = -x.y() * X;
  }
  const SingularValues svd = singularValuesOf(triangularFactor(A), Eigen::ComputeFullV);
  if (!(svd.values[kUnknowns - 2] > kOpen * svd.values[0])) return std::nullopt;
  const Eigen::VectorXd v = svd.V.col(kUnknowns - 1);
  Eigen::Matrix<double, 3, kColumns> M;
  for (int row = 0; row < 3; ++row) M.row(row) = v.segment<kColumns>(row * kColumns).transpose();
  M = N_pixel.inverse() * M * N_point;
  const Eigen::RowVectorXd depths = M.row(2) * points.colwise().homogeneous();
  if (!(depths.minCoeff() > 0 || depths.maxCoeff() < 0)) return std::nullopt;
  if (depths[0] < 0) M = -M;
  return Eigen::Matrix<double, 3, kColumns>(M / M.norm());
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
  // M = K R: rows of R one after the other from the last, as K is upper triangular.
  Eigen::Matrix3d K = Eigen::Matrix3d::Zero(), R;
  for (int i = 2; i >= 0; --i) {
    Eigen::RowVector3d row = M.row(i);
    for (int k = 2; k > i; --k) {
      K(i, k) = row.dot(R.row(k));
      row -= K(i, k) * R.row(k);
    }
    K(i, i) = row.norm();
    R.row(i) = row / K(i, i);
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

std::optional<AgreedProjection> agreedProjection(const Eigen::Matrix3Xd& points_m, const Eigen::Matrix2Xd& pixels_px,
                                                 double tolerance_px, bool flat) {
  constexpr int kDraws = 400;  // Of six points, all right ones once in 1 / 0.75^6 = 6 with a quarter wrong.
  const auto projection = [&](const Eigen::Matrix3Xd& points, const Eigen::Matrix2Xd& pixels) {
    if (!flat) return directLinearTransform(points, pixels);
    std::optional<Matrix34d> P;
    if (const auto H = directLinearHomography(points.topRows<2>(), pixels)) {
      P = Matrix34d::Zero();
      P->leftCols<2>() = H->leftCols<2>();
      P->col(3) = H->col(2);
    }
    return P;
  };
  const auto by = [&](const std::vector<int>& chosen) {
    std::optional<AgreedProjection> agreed;
    const auto P = projection(points_m(Eigen::all, chosen), pixels_px(Eigen::all, chosen));
    if (!P) return agreed;
    agreed = AgreedProjection{*P, {}};
    for (int i = 0; i < static_cast<int>(points_m.cols()); ++i) {
      if (distance_px(*P, points_m.col(i), pixels_px.col(i)) < tolerance_px) agreed->points.push_back(i);
    }
    return agreed;
  };
  std::vector<int> all(static_cast<std::size_t>(points_m.cols()));
  std::iota(all.begin(), all.end(), 0);
  auto best = by(all);
  if (best && best->points.size() == all.size()) return best;
  std::mt19937 engine(1);
  const std::size_t sample = flat ? 4 : 6;
  for (int draw = 0; draw < kDraws && all.size() >= sample; ++draw) {
    std::vector<int> some = all;
    for (std::size_t k = 0; k < sample; ++k) std::swap(some[k], some[k + engine() % (some.size() - k)]);
    some.resize(sample);
    const auto agreed = by(some);
    if (agreed && agreed->points.size() > (best ? best->points.size() : 0)) best = agreed;
  }
  for (int i = 0; best && i < 5; ++i) {
    const auto agreed = by(best->points);
    if (!agreed) break;
    best = agreed;
  }
  return best;
}

double distance_px(const Matrix34d& P, const Eigen::Vector3d& point_m, const Eigen::Vector2d& pixel_px) {
  const Eigen::Vector3d h = P * point_m.homogeneous();
  return h.z() > 0 ? (h.hnormalized() - pixel_px).norm() : std::numeric_limits<double>::infinity();
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
