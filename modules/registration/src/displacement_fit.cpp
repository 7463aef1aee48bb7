// SPDX-License-Identifier: GPL-2.0-or-later
#include "displacement_fit.hpp"

#include <cmath>

namespace angio::registration {
namespace {

// A step of less than this, rms over the points, is rest: a tenth of what an image's centreline is known to [px].
constexpr double kDisplacementRestPx = 0.05;
// A step that changes the cost by less than this share of it is rest, too: with one pixel left at every point, by less
// than a tenth of a pixel.
constexpr double kDisplacementTolerance = 1e-3;
constexpr double kMillimetresPerMetre = 1e3;

void storeScaledIdentity(double scale, double* jacobian) {
  Eigen::Map<Eigen::Matrix3d>{jacobian} = scale * Eigen::Matrix3d::Identity();
}

// Of the points.
class DisplacementMotion final : public StageMotion {
 public:
  DisplacementMotion(const Eigen::Matrix3Xd& displacements_m, double pixels_per_metre)
      : displacements_m_(displacements_m), last_(displacements_m), pixels_per_metre_(pixels_per_metre) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& iteration) override {
    if (iteration.iteration == 0 || !iteration.step_is_successful) return ceres::SOLVER_CONTINUE;
    last_step_px_ = pixels_per_metre_ * std::sqrt((displacements_m_ - last_).colwise().squaredNorm().mean());
    last_ = displacements_m_;
    return last_step_px_ < kDisplacementRestPx ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  const Eigen::Matrix3Xd& displacements_m_;
  Eigen::Matrix3Xd last_;
  double pixels_per_metre_;
};

}  // namespace

bool PointDistanceCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  Eigen::RowVector3d gradient;
  const bool wanted = jacobians && jacobians[0];
  const Eigen::Vector3d p = p_view_ + R_view_first_ * Eigen::Map<const Eigen::Vector3d>(parameters[0]);
  if (!distance_.evaluate(p, residuals, wanted ? &gradient : nullptr)) return false;
  if (wanted) Eigen::Map<Eigen::RowVector3d>{jacobians[0]} = gradient * R_view_first_;
  return true;
}

DisplacementSizeCost::DisplacementSizeCost(double weight) : per_metre_(kMillimetresPerMetre * std::sqrt(weight)) {}

bool DisplacementSizeCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  for (int k = 0; k < 3; ++k) residuals[k] = per_metre_ * parameters[0][k];
  if (jacobians && jacobians[0]) storeScaledIdentity(per_metre_, jacobians[0]);
  return true;
}

DisplacementPairCost::DisplacementPairCost(double weight) : per_metre_(kMillimetresPerMetre * std::sqrt(weight)) {}

bool DisplacementPairCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  for (int k = 0; k < 3; ++k) residuals[k] = per_metre_ * (parameters[0][k] - parameters[1][k]);
  if (!jacobians) return true;
  if (jacobians[0]) storeScaledIdentity(per_metre_, jacobians[0]);
  if (jacobians[1]) storeScaledIdentity(-per_metre_, jacobians[1]);
  return true;
}

DisplacementFit::DisplacementFit(const VesselTree& tree, const IterativePnpSettings& weights)
    : points_m_(tree.points()), size_(weights.lambda2 * weights.w1), pairs_(displacementPairs(tree, weights)) {
  for (const DisplacementPair& pair : pairs_) pair_costs_.emplace_back(weights.lambda2 * pair.weight);
}

StageResult DisplacementFit::solve(const DistanceFrame& frame, const ceres::LossFunction& loss,
                                   const Pose& T_camera_model, int max_iterations, Eigen::Matrix3Xd& displacements_m) {
  const XrayViews& views = frame.views();
  const Eigen::Matrix3Xd p_first = T_camera_model * points_m_;
  Eigen::Matrix3Xd r = T_camera_model.linear() * displacements_m;  // In camera axes: the model's do not matter.
  std::deque<PointDistanceCost> data;
  ceres::Problem::Options owned;
  owned.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  owned.disable_all_safety_checks = true;  // Thousands of blocks, made here.
  ceres::Problem problem(owned);
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (Eigen::Index i = 0; i < r.cols(); ++i) {
      data.emplace_back(frame.field(v), views[v].camera, views[v].T_view_first, p_first.col(i), loss);
      problem.AddResidualBlock(&data.back(), nullptr, r.col(i).data());
    }
  }
  for (Eigen::Index i = 0; i < r.cols(); ++i) problem.AddResidualBlock(&size_, nullptr, r.col(i).data());
  for (std::size_t k = 0; k < pairs_.size(); ++k) {
    problem.AddResidualBlock(&pair_costs_[k], nullptr, r.col(pairs_[k].i).data(), r.col(pairs_[k].j).data());
  }
  DisplacementMotion motion(r, pixelsPerMetre(views, p_first.rowwise().mean()));
  const StageResult result =
      solveStage(problem, ceres::SPARSE_NORMAL_CHOLESKY, max_iterations, kDisplacementTolerance, motion);
  if (result.solved) displacements_m = T_camera_model.linear().transpose() * r;
  return result;
}

}  // namespace angio::registration
