// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>
#include <vector>

#include "angio/registration/dt_icp_settings.hpp"
#include "angio/registration/xray_view.hpp"
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
  DistanceFrame(const DistanceFrame&) = delete;
  DistanceFrame& operator=(const DistanceFrame&) = delete;

  const XrayViews& views() const { return views_; }
  const DistanceField& field(std::size_t view) const { return fields_[view]; }
  /// Whether every view shows a centreline near its detector.
  bool usable() const;

 private:
  std::deque<Centerline2d> centerlines_;  // A deque's elements stay where they are.
  std::deque<DistanceField> fields_;
  XrayViews views_;  // Borrows from centerlines_.
};

/// Largest radius of Ceres' trust region, the inverse of its smallest damping: with a larger one the first steps beside
/// the centreline, where distances have their kink, are refused for many tries. `iterative_pnp` begins with the same.
constexpr double kMaxTrustRegion = 1e4;

/// Returns how many pixels a metre at a point of the first camera's frame is long, in the view that shows it longest.
double pixelsPerMetreAt(const XrayViews& views, const Eigen::Vector3d& p_camera);

/// How a stage ended.
struct StageResult {
  bool solved = false;  ///< Otherwise there was no first system, and nothing has changed.
  int iterations = 0;
  double last_step_px = 0;          ///< Of the projection: roughly and at most.
  double first_cost = 0, cost = 0;  ///< Ceres' own, half the sum [px^2].
};

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
