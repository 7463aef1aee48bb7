// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/registration/oriented_kernel_settings.hpp"
#include "angio/registration/registration.hpp"

namespace angio {

/// What is known of the pose before the image is looked at, for the centred tree: a normal density of xi = log(T0^-1
/// T).
struct PoseBelief {
  Pose T0_camera_centred = Pose::Identity();
  Matrix6d information = Matrix6d::Zero();  ///< Inverse covariance [1/m^2, 1/rad^2].

  double squaredMahalanobis(const Pose& T_camera_centred) const;

  /// Adds the density's Hessian and gradient (of half the squared Mahalanobis distance) for T exp(dx).
  void add(const Pose& T_camera_centred, Matrix6d& H, Vector6d& g) const;
};

/// The prior's own covariance, or the settings' standard deviations.
PoseBelief beliefOf(const PosePrior& prior, const OrientedKernelSettings& settings, const Eigen::Vector3d& centroid);

}  // namespace angio
