// SPDX-License-Identifier: GPL-2.0-or-later
#include "ceres_costs.hpp"

#include <cmath>

#include "angio/geometry/decompositions.hpp"

namespace angio::registration {
namespace {

// Ceres hands out row-major memory.
template <int R, int C>
void store(const Eigen::Matrix<double, R, C>& J, double* memory) {
  Eigen::Map<Eigen::Matrix<double, R, C, Eigen::RowMajor>> target(memory);
  target = J;
}

}  // namespace

ProjectionCost::ProjectionCost(const XrayCamera& camera, const Pose& T_camera_model, const Eigen::Vector3d& p_model,
                               const Eigen::Vector2d& q_px, double weight)
    : camera_(camera),
      T_camera_model_(T_camera_model),
      p_model_(p_model),
      q_px_(q_px),
      sqrt_weight_(std::sqrt(weight)) {}

bool ProjectionCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Eigen::Map<const Vector6d> xi(parameters[0]);
  const Eigen::Map<const Eigen::Vector3d> r(parameters[1]);
  const Pose T = T_camera_model_ * expSE3(xi);
  const Eigen::Vector3d p = p_model_ + r;
  Eigen::Matrix<double, 2, 3> J_projection;
  const auto pixel = camera_.project(T * p, &J_projection);
  if (!pixel) return false;
  Eigen::Map<Eigen::Vector2d>(residuals, 2) = sqrt_weight_ * (*pixel - q_px_);
  if (!jacobians) return true;
  const Eigen::Matrix<double, 2, 3> A = sqrt_weight_ * J_projection * T.linear();
  if (jacobians[0]) {
    // T exp(xi + d) = T exp(xi) exp(Jr(xi) d + ...): the derivative at exp(xi), carried back by the right Jacobian.
    Eigen::Matrix<double, 2, 6> J;
    J << A, -A * skew(p);
    store<2, 6>(J * rightJacobianInverseSE3(xi).inverse(), jacobians[0]);
  }
  if (jacobians[1]) store<2, 3>(A, jacobians[1]);
  return true;
}

PosePriorCost::PosePriorCost(const Pose& T0, const Pose& T, const Matrix6d& information)
    : T0_inverse_T_(T0.inverse() * T), sqrt_information_(lowerFactorOf(information).transpose()) {}

bool PosePriorCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Eigen::Map<const Vector6d> xi(parameters[0]);
  const Twist error = logSE3(T0_inverse_T_ * expSE3(xi));
  Eigen::Map<Vector6d>(residuals, 6) = sqrt_information_ * error;
  if (jacobians && jacobians[0]) {
    store<6, 6>(sqrt_information_ * rightJacobianInverseSE3(error) * rightJacobianInverseSE3(xi).inverse(),
                jacobians[0]);
  }
  return true;
}

}  // namespace angio::registration
