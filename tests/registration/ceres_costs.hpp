// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <ceres/sized_cost_function.h>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// Ceres cost of one match, sqrt(weight) (pi(T exp(xi) (p + r)) - q) [px], with analytic Jacobians.
///
/// Parameter blocks: xi, a twist about the linearisation pose T (6: v [m], w [rad]), and r, the point's displacement
/// (3, [m], model axes). For solvers that want the problem as a whole: bundle adjustment, calibration, reference
/// solutions. Evaluation fails for a point that is not in front of the source.
class ProjectionCost final : public ceres::SizedCostFunction<2, 6, 3> {
 public:
  /// @param T_camera_model  Where xi is zero; @param p_model [m]; @param q_px where the point was seen; @param weight
  /// >= 0.
  ProjectionCost(const XrayCamera& camera, const Pose& T_camera_model, const Eigen::Vector3d& p_model,
                 const Eigen::Vector2d& q_px, double weight);

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  XrayCamera camera_;
  Pose T_camera_model_;
  Eigen::Vector3d p_model_;
  Eigen::Vector2d q_px_;
  double sqrt_weight_;
};

/// Ceres cost of the pose prior, L^T log(T0^-1 T exp(xi)) with information = L L^T, with analytic Jacobian. One block:
/// xi (6).
class PosePriorCost final : public ceres::SizedCostFunction<6, 6> {
 public:
  PosePriorCost(const Pose& T0, const Pose& T, const Matrix6d& information);

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Pose T0_inverse_T_;
  Matrix6d sqrt_information_;
};

}  // namespace angio::registration
