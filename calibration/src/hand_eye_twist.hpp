// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <ceres/rotation.h>

#include <Eigen/Cholesky>

#include "angio/calibration/namespace.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::calibration {

template <typename T>
using Matrix3 = Eigen::Matrix<T, 3, 3>;
template <typename T>
using Vector3 = Eigen::Matrix<T, 3, 1>;

/// (t + dt, exp(dw) R) of a pose, for a Ceres parameter block [dt; dw].
template <typename T>
struct Moved {
  Matrix3<T> R;
  Vector3<T> t;

  Moved(const Pose& from, const T* twist) {
    Matrix3<T> turn;
    ceres::AngleAxisToRotationMatrix(twist + 3, turn.data());
    R = turn * from.linear().cast<T>();
    t = from.translation().cast<T>() + Eigen::Map<const Vector3<T>>(twist);
  }
};

/// The same of numbers.
inline Pose movedBy(const Pose& T, const Vector6d& twist) {
  Pose moved = T;
  moved.translation() += twist.head<3>();
  moved.linear() = expSO3(twist.tail<3>()) * T.linear();
  return moved;
}

/// W with W^T W = covariance^-1.
inline Matrix6d whiteningOf(const Matrix6d& covariance) {
  const Matrix6d L = covariance.llt().matrixL();
  return L.triangularView<Eigen::Lower>().solve(Matrix6d::Identity());
}

}  // namespace angio::calibration
