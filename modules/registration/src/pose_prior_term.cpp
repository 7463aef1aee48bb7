// SPDX-License-Identifier: GPL-2.0-or-later
#include "pose_prior_term.hpp"

namespace angio::registration {

double PosePriorTerm::cost(const Pose& T_camera_centered) const {
  const Twist xi = logSE3(T0_camera_centered.inverse() * T_camera_centered);
  return xi.dot(information * xi);
}

void PosePriorTerm::add(const Pose& T_camera_centered, Matrix6d& H, Vector6d& g) const {
  const Twist xi = logSE3(T0_camera_centered.inverse() * T_camera_centered);
  const Matrix6d J = rightJacobianInverseSE3(xi);
  H.noalias() += J.transpose() * information * J;
  g.noalias() += J.transpose() * (information * xi);
}

PosePriorTerm priorTerm(const IterativePnpSettings& settings, const PosePrior& prior, const Eigen::Vector3d& centroid) {
  PosePriorTerm term;
  term.T0_camera_centered = prior.T_camera_model * Eigen::Translation3d(centroid);
  // The data term counts squared pixels; a covariance is brought to the same currency by the variance of one match.
  const double pixel_variance = settings.pixel_std_px * settings.pixel_std_px;
  if (prior.covariance) {
    term.information = pixel_variance * prior.covariance->inverse();
  } else if (settings.prior == PriorForm::kCovariance) {
    const double rotation = degToRad(settings.prior_rotation_std_deg);
    const double translation = settings.prior_translation_std_mm * 1e-3;
    term.information.diagonal().head<3>().setConstant(pixel_variance / (translation * translation));
    term.information.diagonal().tail<3>().setConstant(pixel_variance / (rotation * rotation));
  } else {
    const double per_metre = settings.prior_length_unit == LengthUnit::kMillimetre ? 1e3 : 1.0;
    term.information.diagonal().head<3>().setConstant(settings.lambda1 * per_metre * per_metre);
    term.information.diagonal().tail<3>().setConstant(settings.lambda1);
  }
  return term;
}

PosePriorTerm beliefOf(const PosePrior& prior, const OrientedKernelSettings& settings,
                       const Eigen::Vector3d& centroid) {
  PosePriorTerm belief;
  belief.T0_camera_centered = prior.T_camera_model * Eigen::Translation3d(centroid);
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

}  // namespace angio::registration
