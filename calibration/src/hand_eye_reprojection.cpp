// SPDX-License-Identifier: GPL-2.0-or-later
#include <ceres/autodiff_cost_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "angio/base/errors.hpp"
#include "hand_eye_problem.hpp"
#include "hand_eye_twist.hpp"

namespace angio::calibration {
namespace {

constexpr double kMinNoise_px = 1e-6;

// One point of the object against its prediction: hand, mount and object, and the hand's error as it shows in the
// camera's frame.
struct PointCost {
  Pose hand_inverse;
  HandEyeTransforms around;
  XrayCamera::Parameters camera;
  Eigen::Vector3d point_m;
  Eigen::Vector2d seen_px;
  double std_px;

  template <typename T>
  bool operator()(const T* x, const T* z, const T* error, T* residual) const {
    const Moved<T> X(around.X, x), Z(around.Z, z);
    const Pose none = Pose::Identity();
    const Moved<T> turn(none, error);
    const Vector3<T> p_base = Z.R * point_m.cast<T>() + Z.t;
    const Vector3<T> p_hand = hand_inverse.linear().cast<T>() * p_base + hand_inverse.translation().cast<T>();
    const Vector3<T> origin =
        X.R.transpose() * (hand_inverse.linear().cast<T>() * Z.t + hand_inverse.translation().cast<T>() - X.t);
    // (t + dt, exp(dw) R): the object turns about its own origin.
    const Vector3<T> p = turn.R * (X.R.transpose() * (p_hand - X.t) - origin) + origin + turn.t;
    if (!(p.z() > T(0))) return false;
    residual[0] = (camera.fx_px * p.x() / p.z() + camera.cx_px - seen_px.x()) / std_px;
    residual[1] = (camera.fy_px * p.y() / p.z() + camera.cy_px - seen_px.y()) / std_px;
    return true;
  }
};

struct ErrorCost {
  Matrix6d whitening;

  template <typename T>
  bool operator()(const T* error, T* residual) const {
    Eigen::Map<Eigen::Matrix<T, 6, 1>> whitened(residual);
    whitened = whitening.cast<T>() * Eigen::Map<const Eigen::Matrix<T, 6, 1>>(error);
    return true;
  }
};

Eigen::MatrixXd dense(const ceres::CRSMatrix& J) {
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(J.num_rows, J.num_cols);
  for (int row = 0; row < J.num_rows; ++row) {
    for (int k = J.rows[row]; k < J.rows[row + 1]; ++k) M(row, J.cols[k]) = J.values[k];
  }
  return M;
}

double imageNoise(const PoseSet& set) {
  double squares = 0, freedom = 0;
  for (const HandEyePose& pose : set.poses) {
    const PoseOfPoints found =
        poseOfPoints(set.path + ": " + pose.name, *set.camera, pose.points_object_m, pose.points_px);
    const auto count = static_cast<double>(pose.points_px.cols());
    squares += found.rms_px * found.rms_px * count;
    freedom += 2 * count - 6;
  }
  return std::max(kMinNoise_px, std::sqrt(squares / freedom));
}

}  // namespace

double reprojectionError(const PoseSet& set, const HandEyeEquations& equations, const HandEyeTransforms& t,
                         std::size_t i) {
  const HandEyePose& pose = set.poses[i];
  const Pose T = HandEyeEquations::predicted(equations.hands[i], t.X, t.Z);
  double squares = 0;
  for (Eigen::Index k = 0; k < pose.points_px.cols(); ++k) {
    const auto pixel = set.camera->project(T * pose.points_object_m.col(k));
    // A point behind the source has no image: it is as far off as the detector is wide.
    squares += pixel ? (*pixel - pose.points_px.col(k)).squaredNorm() : std::pow(set.camera->width_px(), 2);
  }
  return std::sqrt(squares / std::max<double>(1, static_cast<double>(pose.points_px.cols())));
}

ReprojectionFit solvedByReprojection(const PoseSet& set, const HandEyeProblem& from, const HandEyeTransforms& start,
                                     const PoseChoice& chosen, const std::vector<Matrix6d>& hand_covariances) {
  for (const HandEyePose& pose : set.poses) {
    if (pose.points_px.cols() == 0)
      throw InputError(set.path, "points", pose.name, "must be given in every pose for --reprojection");
  }
  const double std_px = imageNoise(set);
  ReprojectionFit fit{start, {}};
  constexpr int kRounds = 2;
  for (int round = 0; round <= kRounds; ++round) {
    ceres::Problem problem;
    Vector6d x = Vector6d::Zero(), z = Vector6d::Zero();
    std::vector<Vector6d> errors(set.poses.size(), Vector6d::Zero());
    std::vector<double*> blocks;
    if (from.mount() == HandEyeMount::kUnknown) blocks.push_back(x.data());
    blocks.push_back(z.data());
    for (std::size_t i = 0; i < set.poses.size(); ++i) {
      if (!chosen[i]) continue;
      const HandEyePose& pose = set.poses[i];
      for (Eigen::Index k = 0; k < pose.points_px.cols(); ++k) {
        auto* cost = new PointCost{from.equations().hands[i].inverse(), fit.transforms,        set.camera->parameters(),
                                   pose.points_object_m.col(k),         pose.points_px.col(k), std_px};
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PointCost, 2, 6, 6, 6>(cost), nullptr, x.data(),
                                 z.data(), errors[i].data());
      }
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<ErrorCost, 6, 6>(new ErrorCost{whiteningOf(hand_covariances[i])}), nullptr,
          errors[i].data());
      blocks.push_back(errors[i].data());
    }
    if (from.mount() == HandEyeMount::kIdentity) problem.SetParameterBlockConstant(x.data());
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_SCHUR;
    options.logging_type = ceres::SILENT;
    options.max_num_iterations = 50;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (round == kRounds) {
      ceres::Problem::EvaluateOptions evaluate;
      evaluate.parameter_blocks = blocks;
      ceres::CRSMatrix J;
      problem.Evaluate(evaluate, nullptr, nullptr, nullptr, &J);
      const Eigen::MatrixXd D = dense(J);
      const Eigen::MatrixXd A = D.transpose() * D;
      const Eigen::Index free = from.mount() == HandEyeMount::kIdentity ? 6 : 12;
      fit.covariance = A.ldlt().solve(Eigen::MatrixXd::Identity(A.rows(), A.cols())).topLeftCorner(free, free);
    }
    fit.transforms.X = movedBy(fit.transforms.X, x);
    fit.transforms.Z = movedBy(fit.transforms.Z, z);
  }
  return fit;
}

}  // namespace angio::calibration
