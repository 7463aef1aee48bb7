// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/sized_cost_function.h>

#include "angio/geometry/se3.hpp"
#include "angio/registration/xray_view.hpp"
#include "distance_field.hpp"
#include "pose_prior_term.hpp"

namespace angio::registration {

/// The pose of a tree about its centroid as Ceres keeps it: R column by column, then t [m], 12 numbers. Points are
/// p_camera = R q + t.
using PoseBlock = Eigen::Matrix<double, 12, 1>;
PoseBlock blockOf(const Pose& T_camera_centered);
Pose poseOf(const PoseBlock& block);

/// SE(3) as the manifold of T exp(dx), dx = [v (m); w (rad)] given in camera axes: R <- exp(w) R, t <- t + V(w) v, V
/// the left Jacobian of SO(3). It is a step about the tree's centroid, and does not depend on the model's axes.
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 12; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* dx, double* x_plus_dx) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

/// The loss of the distance of a projected point from a view's centreline, as a residual whose square it is,
/// sqrt(rho(d^2 + kSoft_px^2)),
/// and its derivative.
///
/// The loss stands inside, as Gauss-Newton then sees the curvature that the square root of Huber's loss has; weights
/// that Ceres puts before a residual see twice as much where the loss is linear, and take half the steps. kSoft_px is
/// there because a distance has no derivative on the centreline.
class DistanceResidual {
 public:
  /// Below what interpolation of the squared distance leaves at bends of the centreline [px].
  static constexpr double kSoft_px = 0.05;

  /// Borrows the field, the view's camera and the loss.
  DistanceResidual(const DistanceField& field, const XrayCamera& camera, const ceres::LossFunction& loss)
      : field_(&field), camera_(&camera), loss_(&loss) {}

  /// @param p_view  In the view's camera frame [m]. Returns false for a point that is not before the source.
  /// @param gradient  Of the residual with respect to p_view [px/m]; may be null.
  bool evaluate(const Eigen::Vector3d& p_view, double* residual_px, Eigen::RowVector3d* gradient) const;

  /// The way to the centreline as a row that a covariance can be made of: d(distance)/d(p_view) [px/m] of length one in
  /// pixels, also for a point that lies on the centreline, times the square root of rho'. False where there is none.
  /// @param weight, square_px2  rho', and rho' times the squared distance.
  bool across(const Eigen::Vector3d& p_view, double* weight, double* square_px2, Eigen::RowVector3d* row) const;

 private:
  const DistanceField* field_;
  const XrayCamera* camera_;
  const ceres::LossFunction* loss_;
};

/// The data term of one view: the loss of the distance of every projected point of the tree, under p_camera = R (I + E)
/// q + t. Parameter blocks: the pose (12) and the strain E as xx, yy, zz, xy, xz, yz (6).
///
/// One cost function for all points, as thousands of them cost Ceres more than the arithmetic: N residuals.
class TreeDistanceCost final : public ceres::CostFunction {
 public:
  /// Borrows everything. @param points_centered  3 x N [m], q. Camera, field and view may not change.
  TreeDistanceCost(const Eigen::Matrix3Xd& points_centered, const DistanceField& field, const XrayView& view,
                   const ceres::LossFunction& loss);

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

  /// Adds the Hessian of the pose (v, w in camera axes, as PoseManifold has it), sum of rho' and of rho' d^2.
  void addInformation(const Pose& T_camera_centered, Matrix6d& H, double& weights, double& squares_px2) const;

 private:
  const Eigen::Matrix3Xd& points_;
  DistanceResidual distance_;
  Pose T_view_first_;
};

/// What holds the strain: weight |E|^2 (Frobenius).
class StrainCost final : public ceres::SizedCostFunction<6, 6> {
 public:
  explicit StrainCost(double weight_px2) : weight_px2_(weight_px2) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  double weight_px2_;
};

/// E_init: L^T log(T0^-1 T) with information = L L^T. One block, the pose.
class StartCost final : public ceres::SizedCostFunction<6, 12> {
 public:
  explicit StartCost(const PosePriorTerm& prior);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Pose T_centered_camera0_;
  Matrix6d sqrt_information_;  // L^T.
};

}  // namespace angio::registration
