// SPDX-License-Identifier: GPL-2.0-or-later
#include "pose_belief.hpp"

namespace angio {

double PoseBelief::squaredMahalanobis(const Pose& T_camera_centred) const {
  const Twist xi = logSE3(T0_camera_centred.inverse() * T_camera_centred);
  return xi.dot(information * xi);
}

void PoseBelief::add(const Pose& T_camera_centred, Matrix6d& H, Vector6d& g) const {
  const Twist xi = logSE3(T0_camera_centred.inverse() * T_camera_centred);
  const Matrix6d J = rightJacobianInverseSE3(xi);
  H.noalias() += J.transpose() * information * J;
  g.noalias() += J.transpose() * (information * xi);
}

PoseBelief beliefOf(const PosePrior& prior, const OrientedKernelSettings& settings, const Eigen::Vector3d& centroid) {
  PoseBelief belief;
  belief.T0_camera_centred = prior.T_camera_model * Eigen::Translation3d(centroid);
  if (prior.covariance) {
    belief.information = prior.covariance->inverse();
  } else {
    const double translation_m = 1e-3 * settings.prior_translation_std_mm,
                 rotation_rad = degToRad(settings.prior_rotation_std_deg);
    belief.information.diagonal().head<3>().setConstant(1 / (translation_m * translation_m));
    belief.information.diagonal().tail<3>().setConstant(1 / (rotation_rad * rotation_rad));
  }
  return belief;
}

}  // namespace angio
