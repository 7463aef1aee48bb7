// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <memory>

#include "angio/geometry/se3.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// How far a fit may be off: of its twist about the tree's centroid, and of where the points of the tree are. Model
/// axes; places about the centroid [m].
class TreeError {
 public:
  virtual ~TreeError() = default;

  /// Returns the covariance of a point's error, all that is uncertain counted [m^2].
  virtual Eigen::Matrix3d pointCovariance(const Eigen::Vector3d& at) const = 0;

  /// Returns the same error without the tails of its deformation; null where it has none.
  virtual std::shared_ptr<const TreeError> central() const { return nullptr; }

  /// Returns the covariance of the twist, whatever the deformation is.
  const Matrix6d& twistCovariance() const { return twist_; }

  /// Returns the part of it that the image's noise alone leaves.
  const Matrix6d& noiseCovariance() const { return noise_; }

  /// Returns the same of a point.
  Eigen::Matrix3d pointNoise(const Eigen::Vector3d& at) const { return moved(noise_, at); }

  /// Returns the amplitude of the deformation: standard deviation, per axis, of what is not linear in it [m].
  double amplitude_m() const { return amplitude_m_; }

 protected:
  static Eigen::Matrix<double, 3, 6> jacobian(const Eigen::Vector3d& at) {
    Eigen::Matrix<double, 3, 6> J;
    J << Eigen::Matrix3d::Identity(), -skew(at);
    return J;
  }
  static Eigen::Matrix3d moved(const Matrix6d& twist, const Eigen::Vector3d& at) {
    return jacobian(at) * twist * jacobian(at).transpose();
  }

  Matrix6d twist_ = Matrix6d::Zero(), noise_ = Matrix6d::Zero();
  double amplitude_m_ = 0;
};

}  // namespace angio::registration
