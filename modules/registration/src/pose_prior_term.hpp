// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/registration/registration.hpp"

namespace angio {

/// E_init of the paper's eq. 4 as a quadratic form: xi^T information xi with xi = log(T0^-1 T), for the pose of the centred
/// tree (rotation about the centroid, paper eq. 3).
///
/// The paper's T acts on the points after T_dsa_cb and the shift by -c. Here T0 holds both, which leaves |log(T0^-1 T)| as
/// it is up to a rotation of the axes.
struct PosePriorTerm {
  Pose T0_camera_centred = Pose::Identity();
  Matrix6d information = Matrix6d::Zero();  ///< [px^2 per m^2, rad^2].

  double cost(const Pose& T_camera_centred) const;

  /// Adds the term's Gauss-Newton Hessian and gradient (half of each) with respect to T exp(dx).
  void add(const Pose& T_camera_centred, Matrix6d& H, Vector6d& g) const;
};

/// The term that settings and prior ask for.
PosePriorTerm priorTerm(const IterativePnpSettings& settings, const PosePrior& prior, const Eigen::Vector3d& centroid);

}  // namespace angio
