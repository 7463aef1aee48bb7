// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <ceres/problem.h>

#include <deque>
#include <vector>

#include "angio/registration/iterative_pnp_settings.hpp"
#include "angio/vessel/vessel_tree.hpp"
#include "displacement_pairs.hpp"
#include "distance_fit.hpp"

namespace angio::registration {

/// The loss of the distance of one displaced point's projection from a view's centreline; block: the displacement (3,
/// [m]), axes of the first camera.
class PointDistanceCost final : public ceres::SizedCostFunction<1, 3> {
 public:
  PointDistanceCost(const DistanceField& field, const XrayCamera& camera, const Pose& T_view_first,
                    const Eigen::Vector3d& p_first, const ceres::LossFunction& loss)
      : distance_(field, camera, loss), R_view_first_(T_view_first.linear()), p_view_(T_view_first * p_first) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  DistanceResidual distance_;
  Eigen::Matrix3d R_view_first_;
  Eigen::Vector3d p_view_;
};

/// weight |r|^2, lengths in mm as in the paper; block: a displacement (3, [m]).
class DisplacementSizeCost final : public ceres::SizedCostFunction<3, 3> {
 public:
  explicit DisplacementSizeCost(double weight);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  double per_metre_;
};

/// weight |r_i - r_j|^2, lengths in mm; blocks: two displacements (3, [m]).
class DisplacementPairCost final : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  explicit DisplacementPairCost(double weight);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  double per_metre_;
};

/// The nonrigid stage: displacements r_i of all points, the pose kept, that minimise the sum of the losses of the
/// distances plus lambda2 E_reg of the paper's eq. 4 (size, chain and neighbour terms): Ceres' Levenberg-Marquardt with
/// a sparse Cholesky factor.
class DisplacementFit {
 public:
  /// @param weights  lambda2, w1, w2, w3 and the neighbours are read.
  DisplacementFit(const VesselTree& tree, const IterativePnpSettings& weights);

  /// Fits `displacements_m` (3 x N, model axes), from where they are.
  StageResult solve(const DistanceFrame& frame, const ceres::LossFunction& loss, const Pose& T_camera_model,
                    int max_iterations, Eigen::Matrix3Xd& displacements_m);

 private:
  const Eigen::Matrix3Xd points_m_;
  DisplacementSizeCost size_;
  std::vector<DisplacementPair> pairs_;
  std::deque<DisplacementPairCost> pair_costs_;  // Cost functions do not move, and nor do a deque's elements.
};

}  // namespace angio::registration
