// SPDX-License-Identifier: GPL-2.0-or-later
#include "model_error.hpp"
#include "angio/geometry/decompositions.hpp"

#include <Eigen/Cholesky>

namespace angio::registration {

ModelError::ModelError(const std::vector<ResidualGroup>& groups, const Matrix6d& information, double currency,
                       double length_m) {
  twist_ = noise_ = inverseOf(information);
  const auto n = static_cast<Eigen::Index>(groups.size());
  if (n < kMinGroups) return;
  groups_ = ResidualArrays(groups);
  process_ = DeformationProcess(groups, length_m, kRigidShape);
  Eigen::MatrixXd deformed = process_.ofResiduals(groups_);
  deformed.triangularView<Eigen::StrictlyUpper>() = deformed.transpose();
  Eigen::Matrix<double, 6, Eigen::Dynamic> pull(6, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const ResidualGroup& group = groups[i];
    pull.col(i) = currency * group.pull * group.jacobian;
  }
  gain_ = information.ldlt().solve(pull);
  if (!gain_.allFinite() || !deformed.allFinite()) return;
  const ErrorSizes sizes = errorSizes(process_, groups);
  amplitude_m_ = kRigidShape.tails * sizes.deformation_m;
  local_m_ = sizes.local_m;
  by_deformation_ = amplitude_m_ * amplitude_m_ * gain_ * deformed * gain_.transpose();
  twist_ += by_deformation_;
}

Eigen::Matrix3d ModelError::pointCovariance(const Eigen::Vector3d& at) const {
  if (amplitude_m_ == 0 && local_m_ == 0) return pointNoise(at);
  // The twist goes with the displacement of the point itself.
  const Eigen::Matrix3d mixed = jacobian(at) * gain_ * process_.withPlace(groups_, at);
  return pointNoise(at) + moved(by_deformation_, at) +
         amplitude_m_ * amplitude_m_ * (process_.covariance(at) - mixed - mixed.transpose()) +
         local_m_ * local_m_ * Eigen::Matrix3d::Identity();
}

}  // namespace angio::registration
