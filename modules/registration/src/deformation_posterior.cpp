// SPDX-License-Identifier: GPL-2.0-or-later
#include "deformation_posterior.hpp"

#include <utility>

#include "angio/geometry/decompositions.hpp"
#include "lower_factor.hpp"

namespace angio::registration {
DeformationPosterior::DeformationPosterior(const std::vector<ResidualGroup>& groups, const PosePriorTerm& belief,
                                           const Pose& T_camera_centered, double length_m, const ProcessShape& shape)
    : DeformationPosterior(groups, {}, errorSizes(DeformationProcess(groups, length_m, shape), groups), belief,
                           T_camera_centered, length_m, shape) {}

DeformationPosterior::DeformationPosterior(const std::vector<ResidualGroup>& groups, Moments moments,
                                           const ErrorSizes& sizes, const PosePriorTerm& belief,
                                           const Pose& T_camera_centered, double length_m, const ProcessShape& shape)
    : groups_(groups), moments_(std::move(moments)), process_(groups, length_m, shape) {
  if (!groups_.noise_px2.allFinite()) return;
  amplitude_m_ = shape.tails * sizes.deformation_m;
  tails_ = shape.tails;
  local_m_ = sizes.local_m;
  noise_px2_ = sizes.together * groups_.noise_px2;
  Vector6d pull = Vector6d::Zero();
  belief.add(T_camera_centered, information_, pull);
  if (!decompose()) return;
  const auto& J = groups_.jacobian;
  noise_ = inverseOf(J.transpose() * noise_px2_.cwiseInverse().asDiagonal() * J + information_);
  mean_ = -twist_ * (whitened_jacobian_.transpose() * factor().solve(groups_.residual_px) + pull);
  weights_ = -factor().transpose().solve(factor().solve(groups_.residual_px + J * mean_));
  known_ = noise_.allFinite() && twist_.allFinite() && mean_.allFinite() && weights_.allFinite();
}

bool DeformationPosterior::decompose() {
  Eigen::MatrixXd C = covarianceOfResiduals(process_, groups_, moments_, amplitude_m_, local_m_);
  if (!C.allFinite()) return false;
  C.diagonal() += noise_px2_;
  if (!factorLower(C)) return false;
  lower_ = std::move(C);
  whitened_jacobian_ = factor().solve(groups_.jacobian);
  twist_ = inverseOf(whitened_jacobian_.transpose() * whitened_jacobian_ + information_);
  return twist_.allFinite();
}

std::shared_ptr<const TreeError> DeformationPosterior::central() const {
  if (tails_ == 1) return nullptr;
  auto result = std::make_shared<DeformationPosterior>(*this);
  result->amplitude_m_ /= tails_;
  result->tails_ = 1;
  return result->decompose() ? result : nullptr;
}

Eigen::ArrayXd DeformationPosterior::ofGroups(const Eigen::MatrixXd& by_moment, Eigen::Index moment) const {
  Eigen::ArrayXd result(groups_.at.cols());
  for (Eigen::Index i = 0; i < result.size(); ++i) result[i] = by_moment(moments_.at(i), moment);
  return result;
}

Eigen::Matrix3Xd DeformationPosterior::displacements(const Eigen::Matrix3Xd& at, Eigen::Index moment) const {
  const double deformation2_m2 = amplitude_m_ * amplitude_m_, local2_m2 = local_m_ * local_m_;
  const Eigen::VectorXd weights = weights_.array() * ofGroups(moments_.deformation, moment);
  const Eigen::VectorXd shifts = weights_.array() * ofGroups(moments_.shift_m2, moment);
  Eigen::Matrix3Xd result =
      process_.ofWeights(groups_, deformation2_m2 * weights, at) + localOfWeights(groups_, local2_m2 * weights_, at);
  result.colwise() += groups_.gradient * shifts;
  return result;
}

Eigen::VectorXd DeformationPosterior::normalizedLeftover() const {
  // Of residuals with covariance C = S + N, N the noise's: what S leaves of them is N C^-1 r.
  return -(noise_px2_.cwiseSqrt().array() * weights_.array()).matrix();
}

Eigen::Matrix3d DeformationPosterior::pointCovariance(const Eigen::Vector3d& at) const {
  const double deformation2_m2 = amplitude_m_ * amplitude_m_, local2_m2 = local_m_ * local_m_;
  const Eigen::Index now = newest();
  const Eigen::VectorXd local =
      (local2_m2 * localCorrelation(groups_.at, at)).array() + ofGroups(moments_.shift_m2, now);
  const Eigen::VectorXd deformation = deformation2_m2 * ofGroups(moments_.deformation, now);
  const Eigen::Matrix<double, Eigen::Dynamic, 3> with =
      deformation.asDiagonal() * process_.withPlace(groups_, at) + local.asDiagonal() * groups_.gradient.transpose();
  const Eigen::Matrix<double, Eigen::Dynamic, 3> seen = factor().solve(with);
  const Eigen::Matrix<double, 3, 6> by_twist = jacobian(at) - seen.transpose() * whitened_jacobian_;
  return deformation2_m2 * moments_.deformation(now, now) * process_.covariance(at) +
         (local2_m2 + moments_.shift_m2(now, now)) * Eigen::Matrix3d::Identity() - seen.transpose() * seen +
         by_twist * twist_ * by_twist.transpose();
}

}  // namespace angio::registration
