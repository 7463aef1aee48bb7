// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/se3.hpp"

#include <cmath>
#include <limits>

#include "angio/geometry/so3.hpp"

namespace angio::geometry {
namespace {

// Below this angle the closed forms lose digits to cancellation and the series are exact to rounding.
constexpr double kSmallAngle = 1e-2;

// sin(a)/a, (1-cos a)/a^2, (a-sin a)/a^3 and the next one that Barfoot's Q needs, (1 - a^2/2 - cos a)/a^4.
struct AngleSeries {
  double a0, a1, a2, a3;
};

AngleSeries angleSeries(double a) {
  const double s = a * a;
  if (a < kSmallAngle) {
    return {1 - s / 6 + s * s / 120 - s * s * s / 5040, 0.5 - s / 24 + s * s / 720 - s * s * s / 40320,
            1.0 / 6 - s / 120 + s * s / 5040, -1.0 / 24 + s / 720 - s * s / 40320};
  }
  return {std::sin(a) / a, (1 - std::cos(a)) / s, (a - std::sin(a)) / (s * a), (1 - s / 2 - std::cos(a)) / (s * s)};
}

// Coupling of translation and rotation in the left Jacobian of SE(3), Barfoot eq. 7.86.
Eigen::Matrix3d leftJacobianQ(const Eigen::Vector3d& v, const Eigen::Vector3d& w) {
  const double a = w.norm(), s = a * a;
  const auto c = angleSeries(a);
  // (a - sin a - a^3/6) / a^5
  const double b = a < kSmallAngle ? -1.0 / 120 + s / 5040 : (a - std::sin(a) - a * s / 6) / (s * s * a);
  const Eigen::Matrix3d V = skew(v), W = skew(w);
  const Eigen::Matrix3d WV = W * V, VW = V * W, WVW = W * VW;
  return 0.5 * V + c.a2 * (WV + VW + WVW) - c.a3 * (W * WV + VW * W - 3 * WVW) -
         0.5 * (c.a3 - 3 * b) * (WVW * W + W * WVW);
}

}  // namespace

Eigen::Matrix3d leftJacobianSO3(const Eigen::Vector3d& w) {
  const auto c = angleSeries(w.norm());
  const Eigen::Matrix3d W = skew(w);
  return Eigen::Matrix3d::Identity() + c.a1 * W + c.a2 * W * W;
}

Eigen::Matrix3d skew(const Eigen::Vector3d& a) {
  Eigen::Matrix3d S;
  S << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return S;
}

Eigen::Matrix3d expSO3(const Eigen::Vector3d& w) {
  const auto c = angleSeries(w.norm());
  const Eigen::Matrix3d W = skew(w);
  return Eigen::Matrix3d::Identity() + c.a0 * W + c.a1 * W * W;
}

Eigen::Vector3d logSO3(const Eigen::Matrix3d& R) {
  // Through the quaternion: well conditioned at zero and at pi.
  Eigen::Quaterniond q(R);
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const double n = q.vec().norm();
  if (n < 1e-12) return 2 * q.vec();
  return 2 * std::atan2(n, q.w()) / n * q.vec();
}

Pose expSE3(const Twist& xi) {
  const Eigen::Vector3d v = xi.head<3>(), w = xi.tail<3>();
  Pose T = Pose::Identity();
  T.linear() = expSO3(w);
  T.translation() = leftJacobianSO3(w) * v;
  return T;
}

Twist logSE3(const Pose& T) {
  const Eigen::Vector3d w = logSO3(T.linear());
  return (Twist() << leftJacobianSO3(w).inverse() * T.translation(), w).finished();
}

Matrix6d adjointSE3(const Pose& T) {
  Matrix6d Ad = Matrix6d::Zero();
  Ad.topLeftCorner<3, 3>() = Ad.bottomRightCorner<3, 3>() = T.linear();
  Ad.topRightCorner<3, 3>() = skew(T.translation()) * T.linear();
  return Ad;
}

Matrix6d rightJacobianInverseSE3(const Twist& xi) {
  // Jr(xi) = Jl(-xi), and the inverse of a block upper triangular matrix is taken block by block.
  const Eigen::Vector3d v = -xi.head<3>(), w = -xi.tail<3>();
  const Eigen::Matrix3d J_inv = leftJacobianSO3(w).inverse();
  Matrix6d result = Matrix6d::Zero();
  result.topLeftCorner<3, 3>() = result.bottomRightCorner<3, 3>() = J_inv;
  result.topRightCorner<3, 3>() = -J_inv * leftJacobianQ(v, w) * J_inv;
  return result;
}

Eigen::Matrix3d nearestRotation(const Eigen::Matrix3d& M) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d D = Eigen::Matrix3d::Identity();
  D(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  return svd.matrixU() * D * svd.matrixV().transpose();
}

double rotationDefect(const Eigen::Matrix3d& R) {
  if (!R.allFinite() || R.determinant() <= 0) return std::numeric_limits<double>::infinity();
  return (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
}

double rotationAngle(const Eigen::Matrix3d& R) { return logSO3(R).norm(); }

}  // namespace angio::geometry
