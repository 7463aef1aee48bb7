// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <ceres/iteration_callback.h>
#include <ceres/problem.h>
#include <ceres/types.h>

#include <deque>
#include <vector>

#include "angio/registration/dt_icp_settings.hpp"
#include "angio/registration/xray_view.hpp"
#include "densified_views.hpp"
#include "distance_costs.hpp"
#include "distance_field.hpp"
#include "pose_prior_term.hpp"

namespace angio::registration {

/// The loss that the settings ask for.
class ChosenLoss {
 public:
  explicit ChosenLoss(const DtIcpSettings& settings);
  const ceres::LossFunction& get() const { return *loss_; }

 private:
  std::unique_ptr<const ceres::LossFunction> loss_;
};

/// What depends on the frame only: the distance transform of each view, and the views with their points put in equal
/// steps.
class DistanceFrame {
 public:
  /// Borrows what the views borrow. @param spacing_px  Longest step of the centrelines in views().
  DistanceFrame(const XrayViews& given, double spacing_px);

  const XrayViews& views() const { return densified_.views(); }
  const DistanceField& field(std::size_t view) const { return fields_[view]; }
  /// Whether every view shows a centreline near its detector.
  bool usable() const;

 private:
  DensifiedViews densified_;
  std::deque<DistanceField> fields_;  // A deque's elements stay where they are.
};

/// Largest radius of Ceres' trust region, the inverse of its smallest damping: with a larger one the first steps beside
/// the centreline, where distances have their kink, are refused for many tries. `iterative_pnp` begins with the same.
constexpr double kMaxTrustRegion = 1e4;

/// How a stage ended.
struct StageResult {
  bool solved = false;  ///< Otherwise there was no first system, and nothing has changed.
  int iterations = 0;
  double last_step_px = 0;          ///< Of the projection: roughly and at most.
  double first_cost = 0, cost = 0;  ///< Ceres' own, half the sum [px^2].
};

/// Ends a solve whose steps no longer move the picture, and keeps how far the last one did.
class StageMotion : public ceres::IterationCallback {
 public:
  double last_step_px() const { return last_step_px_; }

 protected:
  double last_step_px_ = 0;
};

/// Ceres' Levenberg-Marquardt for one stage: silent, with the bounded trust region, as far as `motion` lets it.
StageResult solveStage(ceres::Problem& problem, ceres::LinearSolverType linear_solver, int max_iterations,
                       double function_tolerance, StageMotion& motion);

/// The affine and the rigid stage on one frame: Ceres' Levenberg-Marquardt on the pose about the centroid, dense.
///
/// All is done in camera axes, from the start on, so that the model's axes do not matter.
class PoseFit {
 public:
  /// Borrows frame and loss. @param points_centered  3 x N [m], about the centroid, model axes.
  PoseFit(const DistanceFrame& frame, const ceres::LossFunction& loss, const Eigen::Matrix3Xd& points_centered,
          const PosePriorTerm& prior, const Pose& start_camera_centered);
  PoseFit(const PoseFit&) = delete;
  PoseFit& operator=(const PoseFit&) = delete;

  /// Pose and strain together, p = R (I + E) q + t. The strain is then let go: R is the nearest rotation.
  StageResult affine(int max_iterations);
  /// The pose alone.
  StageResult rigid(int max_iterations);

  Pose T_camera_centered() const;

  /// Covariance of [v; w] about the centroid, model axes: residual variance times the inverse Hessian, points taken as
  /// independent. Nothing where the Hessian is not of full rank.
  std::optional<Matrix6d> covariance() const;

 private:
  StageResult solve(bool with_strain, int max_iterations, double function_tolerance);

  const DistanceFrame& frame_;
  Eigen::Matrix3d R_start_;
  Eigen::Matrix3Xd turned_;  // R_start times the centred points.
  double radius_m_;
  PosePriorTerm prior_;  // In the axes of turned_.
  PoseBlock pose_;
  Vector6d strain_ = Vector6d::Zero();
  std::deque<TreeDistanceCost> data_;  // One for each view.
  StrainCost strain_cost_;
  std::optional<StartCost> start_cost_;
  PoseManifold manifold_;
};

}  // namespace angio::registration
