// SPDX-License-Identifier: GPL-2.0-or-later
#include "trend_filter.hpp"

#include <Eigen/Cholesky>

namespace angio::motion {

double squaredMahalanobis(const Eigen::Vector3d& z, const Eigen::Matrix3d& S) { return z.dot(S.ldlt().solve(z)); }

TrendFilter::TrendFilter(const Eigen::Vector3d& position, const Eigen::Matrix3d& R, double first_speed_std_m_per_s,
                         double acceleration_density)
    : first_speed_std_(first_speed_std_m_per_s), density_(acceleration_density) {
  restart(position, R);
}

void TrendFilter::restart(const Eigen::Vector3d& z, const Eigen::Matrix3d& R) {
  x_ << z, Eigen::Vector3d::Zero();
  P_.setZero();
  P_.topLeftCorner<3, 3>() = R;
  P_.bottomRightCorner<3, 3>().diagonal().setConstant(first_speed_std_ * first_speed_std_);
}

void TrendFilter::advance(double dt) {
  x_.head<3>() += dt * x_.tail<3>();
  P_.topRows<3>() += dt * P_.bottomRows<3>().eval();
  P_.leftCols<3>() += dt * P_.rightCols<3>().eval();
  for (int i = 0; i < 3; ++i) {
    P_(i, i) += density_ * dt * dt * dt / 3;
    P_(i, i + 3) += density_ * dt * dt / 2;
    P_(i + 3, i) += density_ * dt * dt / 2;
    P_(i + 3, i + 3) += density_ * dt;
  }
}

PositionEstimate TrendFilter::ahead(double horizon_s) const {
  TrendFilter then = *this;
  then.advance(horizon_s);
  return {then.x_.head<3>(), then.P_.topLeftCorner<3, 3>()};
}

PositionEstimate TrendFilter::held(double horizon_s) const {
  const Eigen::Vector3d moved = horizon_s * x_.tail<3>();
  return {x_.head<3>(), ahead(horizon_s).covariance + moved * moved.transpose()};
}

void TrendFilter::correct(const Eigen::Vector3d& z, const Eigen::Matrix3d& R) {
  const Eigen::Matrix3d S = P_.topLeftCorner<3, 3>() + R;
  const Eigen::Matrix<double, 6, 3> K = S.ldlt().solve(P_.topRows<3>()).transpose();
  x_ += K * (z - x_.head<3>());
  // Joseph's form stays positive.
  Matrix6d A = Matrix6d::Identity();
  A.leftCols<3>() -= K;
  P_ = Matrix6d(A * P_ * A.transpose() + K * R * K.transpose());
}

}  // namespace angio::motion
