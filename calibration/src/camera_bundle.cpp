// SPDX-License-Identifier: GPL-2.0-or-later
#include "camera_bundle.hpp"

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

namespace angio::calibration {
namespace {

// d exp(w) q / dw = -skew(exp(w) q) Jl(w), the left Jacobian of SO(3). Source: Barfoot (2017), eq. 7.77.
Eigen::Matrix3d leftJacobianSO3(const Eigen::Vector3d& w) {
  const double angle2 = w.squaredNorm(), angle = std::sqrt(angle2);
  const Eigen::Matrix3d W = skew(w);
  if (angle < 1e-4) return Eigen::Matrix3d::Identity() + 0.5 * W + W * W / 6;
  return Eigen::Matrix3d::Identity() + (1 - std::cos(angle)) / angle2 * W +
         (angle - std::sin(angle)) / (angle2 * angle) * W * W;
}

class BeadCost final : public ceres::CostFunction {
 public:
  BeadCost(const CameraBundle& bundle, const BundleView& view, Eigen::Index bead)
      : model_(bundle.model),
        parameters_(&bundle.parameters),
        distance_m_(view.distance_m),
        turned_m_(view.T_camera_phantom.linear() * view.points_m.col(bead)),
        t_m_(view.T_camera_phantom.translation()),
        seen_px_(view.seen_px.col(bead)),
        weight_(1 / view.stds_px[bead]) {
    set_num_residuals(2);
    *mutable_parameter_block_sizes() = {static_cast<int>(bundle.values.size()), 6};
  }

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const Eigen::Index n = parameters_->map.cols();
    const LensNumbers lens = parameters_->fixed + parameters_->map * Eigen::Map<const Eigen::VectorXd>(blocks[0], n);
    const Eigen::Map<const Eigen::Vector3d> v(blocks[1]), w(blocks[1] + 3);
    const Eigen::Vector3d turned_m = expSO3(w) * turned_m_, p_m = turned_m + t_m_ + v;
    if (!(p_m.z() > 0)) return false;
    Eigen::Matrix<double, 2, 3> J_point;
    Eigen::Matrix<double, 2, kLensNumbers> J_lens;
    const Eigen::Vector2d px = model_.seen(lens, distance_m_, p_m, jacobians ? &J_point : nullptr,
                                           jacobians && jacobians[0] ? &J_lens : nullptr);
    Eigen::Map<Eigen::Vector2d> r(residuals);
    r = weight_ * (px - seen_px_);
    if (!jacobians) return r.allFinite();
    using RowMajor = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>;
    if (jacobians[0]) Eigen::Map<RowMajor>(jacobians[0], 2, n).noalias() = weight_ * J_lens * parameters_->map;
    if (jacobians[1]) {
      Eigen::Map<Eigen::Matrix<double, 2, 6, Eigen::RowMajor>> J(jacobians[1]);
      J.leftCols<3>() = weight_ * J_point;
      J.rightCols<3>() = -weight_ * J_point * skew(turned_m) * leftJacobianSO3(w);
    }
    return r.allFinite();
  }

 private:
  const LensModel& model_;
  const LensParameters* parameters_;
  double distance_m_;
  Eigen::Vector3d turned_m_, t_m_;
  Eigen::Vector2d seen_px_;
  double weight_;
};

void moveBy(Pose& T, const Vector6d& step) {
  T.linear() = nearestRotation(expSO3(step.tail<3>()) * T.linear());
  T.translation() += step.head<3>();
}

double squaredOver(const CameraBundle& bundle, const BundleView& view) {
  const Eigen::Matrix2Xd r = bundle.residualsOf(view);
  double sum = 0;
  for (Eigen::Index i = 0; i < r.cols(); ++i) {
    if (view.use[static_cast<std::size_t>(i)]) sum += (r.col(i) / view.stds_px[i]).squaredNorm();
  }
  return sum;
}

}  // namespace

std::unique_ptr<ceres::CostFunction> beadCost(const CameraBundle& bundle, const BundleView& view, Eigen::Index bead) {
  return std::make_unique<BeadCost>(bundle, view, bead);
}

Eigen::Matrix2Xd CameraBundle::residualsOf(const BundleView& view) const {
  const LensNumbers numbers = lens();
  Eigen::Matrix2Xd r(2, view.points_m.cols());
  for (Eigen::Index i = 0; i < r.cols(); ++i) {
    const Eigen::Vector3d p_m = view.T_camera_phantom * view.points_m.col(i);
    if (p_m.z() > 0) {
      r.col(i) = model.seen(numbers, view.distance_m, p_m) - view.seen_px.col(i);
    } else {
      r.col(i).setConstant(std::numeric_limits<double>::infinity());
    }
  }
  return r;
}

bool CameraBundle::solve(std::optional<double> robust_scale, int max_iterations) {
  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  ceres::CauchyLoss cauchy(robust_scale.value_or(1));
  std::vector<Vector6d> steps(views.size(), Vector6d::Zero());
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  ordering->AddElementToGroup(values.data(), 1);
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (std::size_t i = 0; i < views[v].use.size(); ++i) {
      if (!views[v].use[i]) continue;
      problem.AddResidualBlock(beadCost(*this, views[v], static_cast<Eigen::Index>(i)).release(),
                               robust_scale ? &cauchy : nullptr, values.data(), steps[v].data());
    }
    ordering->AddElementToGroup(steps[v].data(), 0);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.linear_solver_ordering = ordering;
  options.max_num_iterations = max_iterations;
  options.function_tolerance = 1e-14;
  options.parameter_tolerance = 1e-12;
  options.gradient_tolerance = 1e-12;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  for (std::size_t v = 0; v < views.size(); ++v) moveBy(views[v].T_camera_phantom, steps[v]);
  return summary.IsSolutionUsable();
}

Pose fittedPose(const CameraBundle& bundle, const BundleView& start) {
  BundleView view = start;
  double squared = squaredOver(bundle, view), damping = 1e-6;
  for (int i = 0; i < 100; ++i) {
    const ViewInformation at = informationOf(bundle, view);
    Matrix6d H = at.pose;
    H.diagonal() *= 1 + damping;
    const Vector6d step = -H.ldlt().solve(at.pose_gradient);
    if (!step.allFinite()) break;
    BundleView moved = view;
    moveBy(moved.T_camera_phantom, step);
    const double now = squaredOver(bundle, moved);
    if (now <= squared) {
      const bool still = squared - now <= 1e-14 * squared;
      view.T_camera_phantom = moved.T_camera_phantom;
      squared = now;
      damping = std::max(1e-9, 0.1 * damping);
      if (still) break;
    } else if ((damping *= 10) > 1e6) {
      break;
    }
  }
  return view.T_camera_phantom;
}

Eigen::MatrixXd ViewInformation::reducedLens() const { return lens - cross * pose.ldlt().solve(cross.transpose()); }

Eigen::VectorXd ViewInformation::reducedGradient() const {
  return lens_gradient - cross * pose.ldlt().solve(pose_gradient);
}

ViewInformation informationOf(const CameraBundle& bundle, const BundleView& view) {
  const Eigen::Index n = bundle.values.size();
  ViewInformation sum;
  sum.lens = Eigen::MatrixXd::Zero(n, n);
  sum.pose.setZero();
  sum.cross = Eigen::MatrixXd::Zero(n, 6);
  sum.lens_gradient = Eigen::VectorXd::Zero(n);
  sum.pose_gradient.setZero();
  const LensNumbers lens = bundle.lens();
  Eigen::Matrix<double, 2, 3> J_point;
  Eigen::Matrix<double, 2, kLensNumbers> J_numbers;
  for (Eigen::Index i = 0; i < view.points_m.cols(); ++i) {
    if (!view.use[static_cast<std::size_t>(i)]) continue;
    const Eigen::Vector3d turned_m = view.T_camera_phantom.linear() * view.points_m.col(i);
    const Eigen::Vector3d p_m = turned_m + view.T_camera_phantom.translation();
    if (!(p_m.z() > 0)) continue;
    const double weight = 1 / view.stds_px[i];
    const Eigen::Vector2d r =
        weight * (bundle.model.seen(lens, view.distance_m, p_m, &J_point, &J_numbers) - view.seen_px.col(i));
    const Eigen::MatrixXd J_lens = weight * J_numbers * bundle.parameters.map;
    Eigen::Matrix<double, 2, 6> J_pose;
    J_pose << weight * J_point, -weight * J_point * skew(turned_m);
    sum.lens.noalias() += J_lens.transpose() * J_lens;
    sum.pose.noalias() += J_pose.transpose() * J_pose;
    sum.cross.noalias() += J_lens.transpose() * J_pose;
    sum.lens_gradient.noalias() += J_lens.transpose() * r;
    sum.pose_gradient.noalias() += J_pose.transpose() * r;
    sum.squared += r.squaredNorm();
    sum.residuals += 2;
  }
  return sum;
}

}  // namespace angio::calibration
