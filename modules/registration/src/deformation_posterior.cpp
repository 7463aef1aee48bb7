// SPDX-License-Identifier: GPL-2.0-or-later
#include "deformation_posterior.hpp"

namespace angio::registration {
DeformationPosterior::DeformationPosterior(const std::vector<ResidualGroup>& groups, const PosePriorTerm& belief,
                                           const Pose& T_camera_centered, double length_m, double tails)
    : groups_(groups), process_(groups, length_m, kGrowth) {
  const Eigen::MatrixXd deformed = process_.ofResiduals(groups_);
  if (!deformed.allFinite() || !groups_.noise_px2.allFinite()) return;
  const ErrorSizes sizes = errorSizes(process_, groups);
  amplitude_m_ = tails * sizes.deformation_m;
  local_m_ = sizes.local_m;
  const Eigen::VectorXd noise_px2 = sizes.together * groups_.noise_px2;

  Eigen::MatrixXd C = amplitude_m_ * amplitude_m_ * deformed + local_m_ * local_m_ * localErrorOfResiduals(groups_);
  C.diagonal() += noise_px2;
  factor_.compute(C);
  if (factor_.info() != Eigen::Success) return;
  Matrix6d information = Matrix6d::Zero();
  Vector6d pull = Vector6d::Zero();
  belief.add(T_camera_centered, information, pull);
  const auto& J = groups_.jacobian;
  whitened_jacobian_ = factor_.matrixL().solve(J);
  noise_ = (J.transpose() * noise_px2.cwiseInverse().asDiagonal() * J + information).inverse();
  twist_ = (whitened_jacobian_.transpose() * whitened_jacobian_ + information).inverse();
  mean_ = -twist_ * (whitened_jacobian_.transpose() * factor_.matrixL().solve(groups_.residual_px) + pull);
  weights_ = -factor_.solve(groups_.residual_px + J * mean_);
  known_ = noise_.allFinite() && twist_.allFinite() && mean_.allFinite() && weights_.allFinite();
}

Eigen::Matrix3Xd DeformationPosterior::displacements(const Eigen::Matrix3Xd& at) const {
  const double deformation2_m2 = amplitude_m_ * amplitude_m_;
  const Eigen::MatrixXd alike =
      deformation2_m2 * process_.alike(groups_.at, at) + local_m_ * local_m_ * localCorrelation(groups_.at, at);
  return groups_.gradient * weights_.asDiagonal() * alike +
         deformation2_m2 * process_.growth() * groups_.outwards.dot(weights_) * at;
}

Eigen::Matrix3d DeformationPosterior::pointCovariance(const Eigen::Vector3d& at) const {
  const double deformation2_m2 = amplitude_m_ * amplitude_m_, local2_m2 = local_m_ * local_m_;
  const Eigen::VectorXd local = local2_m2 * localCorrelation(groups_.at, at);
  const Eigen::Matrix<double, Eigen::Dynamic, 3> with =
      deformation2_m2 * process_.withPlace(groups_, at) + local.asDiagonal() * groups_.gradient.transpose();
  const Eigen::Matrix<double, Eigen::Dynamic, 3> seen = factor_.matrixL().solve(with);
  const Eigen::Matrix<double, 3, 6> by_twist = jacobian(at) - seen.transpose() * whitened_jacobian_;
  return deformation2_m2 * process_.covariance(at) + local2_m2 * Eigen::Matrix3d::Identity() - seen.transpose() * seen +
         by_twist * twist_ * by_twist.transpose();
}

}  // namespace angio::registration
