// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Geometry>

#include "angio/geometry/namespace.hpp"

namespace angio::geometry {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// A rigid transform `T_a_b` maps points from frame b into frame a; subscripts must cancel. Lengths in metres.
using Pose = Eigen::Isometry3d;

/// A twist is [v; w], translation first as ViSP has it: v [m or m/s], w [rad or rad/s].
using Twist = Vector6d;

/// The matrix of the cross product: skew(a) b = a x b.
Eigen::Matrix3d skew(const Eigen::Vector3d& a);

/// Rotation vector [rad] to rotation matrix (Rodrigues).
Eigen::Matrix3d expSO3(const Eigen::Vector3d& w);

/// Rotation matrix to rotation vector [rad], angle in [0, pi].
Eigen::Vector3d logSO3(const Eigen::Matrix3d& R);

/// SE(3) exponential of a twist. Source: Barfoot, State Estimation for Robotics (2017), eq. 7.34.
Pose expSE3(const Twist& xi);

/// SE(3) logarithm; expSE3(logSE3(T)) = T for rotation angles below pi.
Twist logSE3(const Pose& T);

/// Ad(T): T exp(xi) T^-1 = exp(Ad(T) xi).
Matrix6d adjointSE3(const Pose& T);

/// Inverse of the right Jacobian: log(exp(xi) exp(d)) = xi + Jr^-1(xi) d + O(d^2).
/// Source: Barfoot (2017), section 7.1.5 (here for translation-first twists).
Matrix6d rightJacobianInverseSE3(const Twist& xi);

/// The nearest rotation matrix in the Frobenius norm (SVD), with determinant +1.
Eigen::Matrix3d nearestRotation(const Eigen::Matrix3d& M);

/// The largest entry of |R^T R - I|, or infinity when an entry is not finite or the determinant is not positive: how
/// far a matrix is from being a rotation.
double rotationDefect(const Eigen::Matrix3d& R);

/// Rotation angle of R, in [0, pi] [rad]; accurate near zero.
double rotationAngle(const Eigen::Matrix3d& R);

constexpr double kPi = 3.14159265358979323846;
constexpr double degToRad(double angle_deg) { return angle_deg * kPi / 180.0; }
constexpr double radToDeg(double angle_rad) { return angle_rad * 180.0 / kPi; }

}  // namespace angio::geometry
