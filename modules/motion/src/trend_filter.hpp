// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

#include "angio/motion/namespace.hpp"

namespace angio::motion {

/// A position with its covariance.
struct PositionEstimate {
  Eigen::Vector3d position;
  Eigen::Matrix3d covariance;
};

/// z^T S^-1 z.
double squaredMahalanobis(const Eigen::Vector3d& z, const Eigen::Matrix3d& S);

/// Kalman filter of a point with constant velocity and white acceleration.
class TrendFilter {
 public:
  /// @param acceleration_density  Of the white acceleration, per axis [m^2/s^3].
  TrendFilter(const Eigen::Vector3d& position, const Eigen::Matrix3d& R, double first_speed_std_m_per_s,
              double acceleration_density);

  void advance(double dt_s);
  PositionEstimate ahead(double horizon_s) const;  ///< Constant velocity.
  PositionEstimate held(double horizon_s) const;   ///< No velocity: its square is part of the covariance.
  void correct(const Eigen::Vector3d& z, const Eigen::Matrix3d& R);

  /// Begins again at a place, with the speed unknown.
  void restart(const Eigen::Vector3d& z, const Eigen::Matrix3d& R);

 private:
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  Eigen::Matrix<double, 6, 1> x_;  // Position, velocity.
  Matrix6d P_;
  double first_speed_std_, density_;
};

}  // namespace angio::motion
