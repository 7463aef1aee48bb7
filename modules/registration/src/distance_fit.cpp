// SPDX-License-Identifier: GPL-2.0-or-later
#include "distance_fit.hpp"

#include <ceres/solver.h>

#include <algorithm>
#include <cmath>

#include "angio/geometry/decompositions.hpp"
#include "fit_classification.hpp"

namespace angio::registration {
namespace {

// A step that moves no projected point by more than this is rest [px].
constexpr double kPoseRestPx = 1e-2;
// A step that changes the cost by less than this share of it is rest, too. What is left of a noise-free image is 0.3 px
// at a point, of which 1e-4 moves the pose by less than kPoseRestPx. The affine stage is only a start.
constexpr double kAffineTolerance = 1e-2, kRigidTolerance = 1e-4;
// A strain of so much in every direction costs as much as one pixel at every point: large enough for a solver to use
// it, small enough for one view to determine it beside the distance from the source.
constexpr double kStrainForOnePixel = 0.02;

// Of the pose.
class PoseMotion final : public StageMotion {
 public:
  PoseMotion(const PoseBlock& pose, const XrayViews& views, double radius_m)
      : pose_(pose), last_(pose), views_(views), radius_m_(radius_m) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& iteration) override {
    if (iteration.iteration == 0 || !iteration.step_is_successful) return ceres::SOLVER_CONTINUE;
    Twist step;
    PoseManifold().Minus(pose_.data(), last_.data(), step.data());
    last_ = pose_;
    last_step_px_ = moved_px(step);
    return last_step_px_ < kPoseRestPx ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  // In the view that shows it most; what goes along the beam moves the picture by its growth only.
  double moved_px(const Twist& step) const {
    double most = 0;
    for (const XrayView& view : views_) {
      const Eigen::Vector3d p = view.T_view_first * Eigen::Vector3d(pose_.tail<3>()),
                            v = view.T_view_first.linear() * step.head<3>();
      const double depth_m = std::max(1e-3, p.z()), growth = std::abs(v.z()) / depth_m;
      const double across_m = (v.head<2>() - v.z() / depth_m * p.head<2>()).norm();
      const double moved_m = across_m + radius_m_ * (step.tail<3>().norm() + growth);
      most = std::max(most, view.camera.parameters().fx_px / depth_m * moved_m);
    }
    return most;
  }

  const PoseBlock& pose_;
  PoseBlock last_;
  const XrayViews& views_;
  double radius_m_;
};

}  // namespace

ChosenLoss::ChosenLoss(const DtIcpSettings& settings) {
  if (settings.loss == DistanceLoss::kHuber) {
    loss_ = std::make_unique<ceres::HuberLoss>(settings.huber_px);
  } else {
    loss_ = std::make_unique<ceres::TrivialLoss>();
  }
}

DistanceFrame::DistanceFrame(const XrayViews& given, double spacing_px) : densified_(given, spacing_px) {
  // Lines: points on them change nothing.
  for (const XrayView& view : given) fields_.emplace_back(view.centerline, view.camera);
}

bool DistanceFrame::usable() const {
  return std::none_of(fields_.begin(), fields_.end(), [](const DistanceField& field) { return field.empty(); });
}

StageResult solveStage(ceres::Problem& problem, ceres::LinearSolverType linear_solver, int max_iterations,
                       double function_tolerance, StageMotion& motion) {
  ceres::Solver::Options options;
  options.linear_solver_type = linear_solver;
  options.max_num_iterations = max_iterations;
  options.function_tolerance = function_tolerance;
  options.max_trust_region_radius = kMaxTrustRegion;
  options.logging_type = ceres::SILENT;
  options.update_state_every_iteration = true;
  options.callbacks = {&motion};
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) return {};
  return {true, static_cast<int>(summary.iterations.size()) - 1, motion.last_step_px(), summary.initial_cost,
          summary.final_cost};
}

PoseFit::PoseFit(const DistanceFrame& frame, const ceres::LossFunction& loss, const Eigen::Matrix3Xd& points_centered,
                 const PosePriorTerm& prior, const Pose& start_camera_centered)
    : frame_(frame),
      R_start_(start_camera_centered.linear()),
      turned_(R_start_ * points_centered),
      radius_m_(std::sqrt(points_centered.colwise().squaredNorm().maxCoeff())),
      prior_(prior),
      strain_cost_(static_cast<double>(points_centered.cols()) / (kStrainForOnePixel * kStrainForOnePixel)) {
  Pose turn = Pose::Identity(), start = start_camera_centered;
  turn.linear() = R_start_;
  start.linear().setIdentity();
  pose_ = blockOf(start);
  // log(T0^-1 T) with T = T' turn is turn^-1 log((T0 turn^-1)^-1 T') turn.
  const Matrix6d back = adjointSE3(turn.inverse());
  prior_.T0_camera_centered = prior.T0_camera_centered * turn.inverse();
  prior_.information = back.transpose() * prior.information * back;
  for (std::size_t v = 0; v < frame.views().size(); ++v) {
    data_.emplace_back(turned_, frame.field(v), frame.views()[v], loss);
  }
  if (prior.source != PriorInForce::kNone) start_cost_.emplace(prior_);
}

StageResult PoseFit::affine(int max_iterations) {
  const StageResult result = solve(true, max_iterations, kAffineTolerance);
  strain_.setZero();
  return result;
}

StageResult PoseFit::rigid(int max_iterations) { return solve(false, max_iterations, kRigidTolerance); }

StageResult PoseFit::solve(bool with_strain, int max_iterations, double function_tolerance) {
  ceres::Problem::Options owned;
  owned.cost_function_ownership = owned.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(owned);
  problem.AddParameterBlock(pose_.data(), 12, &manifold_);
  problem.AddParameterBlock(strain_.data(), 6);
  for (TreeDistanceCost& cost : data_) problem.AddResidualBlock(&cost, nullptr, pose_.data(), strain_.data());
  if (start_cost_) problem.AddResidualBlock(&*start_cost_, nullptr, pose_.data());
  if (with_strain) {
    problem.AddResidualBlock(&strain_cost_, nullptr, strain_.data());
  } else {
    problem.SetParameterBlockConstant(strain_.data());
  }
  // A start without an image ends here: the solver would tell it on the error stream, silent or not.
  double first_cost = 0;
  if (!problem.Evaluate(ceres::Problem::EvaluateOptions(), &first_cost, nullptr, nullptr, nullptr)) return {};
  PoseMotion motion(pose_, frame_.views(), radius_m_);
  const StageResult result =
      solveStage(problem, ceres::DENSE_NORMAL_CHOLESKY, max_iterations, function_tolerance, motion);
  if (!result.solved) return result;
  Pose T = poseOf(pose_);
  T.linear() = nearestRotation(T.linear());
  pose_ = blockOf(T);
  return result;
}

Pose PoseFit::T_camera_centered() const {
  Pose T = poseOf(pose_);
  T.linear() = nearestRotation(T.linear() * R_start_);
  return T;
}

std::optional<Matrix6d> PoseFit::covariance() const {
  const Pose T = poseOf(pose_);
  Matrix6d H_camera_axes = Matrix6d::Zero();
  double weights = 0, squares_px2 = 0;
  for (const TreeDistanceCost& cost : data_) cost.addInformation(T, H_camera_axes, weights, squares_px2);
  // To the twist of T exp(.), in the axes that the prior has it in, and on to the model's.
  Matrix6d turn = Matrix6d::Zero(), from_model = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = T.linear();
  from_model.topLeftCorner<3, 3>() = from_model.bottomRightCorner<3, 3>() = R_start_;
  Matrix6d H = turn.transpose() * H_camera_axes * turn;
  if (start_cost_) {
    Vector6d unused = Vector6d::Zero();
    prior_.add(T, H, unused);
  }
  H = from_model.transpose() * H * from_model;
  if (!isFullRank(H)) return std::nullopt;
  const double variance_px2 = squares_px2 / std::max(1.0, weights - 6);
  return variance_px2 * inverseOf(H);
}

}  // namespace angio::registration
