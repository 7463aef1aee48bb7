// SPDX-License-Identifier: GPL-2.0-or-later
#include "hand_eye_problem.hpp"

#include <ceres/autodiff_cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/rotation.h>
#include <ceres/solver.h>

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/geometry/decompositions.hpp"

namespace angio::calibration {
namespace {

constexpr int kRelinearisations = 3;
// What stands in for no noise at all: far below any measurement, far above rounding [m, rad].
constexpr double kMinStd = 1e-8;
constexpr double kRobustScale = 3;  // Sigma of a six-dimensional residual at which the robust loss lets go.

template <typename T>
using Matrix3 = Eigen::Matrix<T, 3, 3>;
template <typename T>
using Vector3 = Eigen::Matrix<T, 3, 1>;

// (t + dt, exp(dw) R) of a pose, for a Ceres parameter block [dt; dw].
template <typename T>
struct Moved {
  Matrix3<T> R;
  Vector3<T> t;

  Moved(const Pose& from, const T* twist) {
    Matrix3<T> turn;
    ceres::AngleAxisToRotationMatrix(twist + 3, turn.data());
    R = turn * from.linear().cast<T>();
    t = from.translation().cast<T>() + Eigen::Map<const Vector3<T>>(twist);
  }
};

// W with W^T W = covariance^-1.
Matrix6d whiteningOf(const Matrix6d& covariance) {
  return lowerFactorOf(covariance).triangularView<Eigen::Lower>().solve(Matrix6d::Identity());
}

struct HandEyeCost {
  Pose hand_inverse, camera;
  HandEyeTransforms around;
  Matrix6d whitening;

  template <typename T>
  bool operator()(const T* x, const T* z, T* residual) const {
    const Moved<T> X(around.X, x), Z(around.Z, z);
    const Matrix3<T> R_h = hand_inverse.linear().cast<T>();
    const Matrix3<T> R = X.R.transpose() * R_h * Z.R;
    const Vector3<T> t = X.R.transpose() * (R_h * Z.t + hand_inverse.translation().cast<T>() - X.t);
    const Matrix3<T> turn = camera.linear().cast<T>() * R.transpose();
    Eigen::Matrix<T, 6, 1> raw;
    raw.template head<3>() = camera.translation().cast<T>() - t;
    ceres::RotationMatrixToAngleAxis(turn.data(), raw.data() + 3);
    Eigen::Map<Eigen::Matrix<T, 6, 1>> whitened(residual);
    whitened = whitening.cast<T>() * raw;
    return true;
  }
};

Matrix6d isotropic(const PoseSigma& sigma) {
  Vector6d variances;
  variances.head<3>().setConstant(sigma.translation_m * sigma.translation_m);
  variances.tail<3>().setConstant(sigma.rotation_rad * sigma.rotation_rad);
  return variances.asDiagonal();
}

struct Blocks {
  Vector6d x = Vector6d::Zero(), z = Vector6d::Zero();
};

void addPoses(ceres::Problem& problem, Blocks& blocks, const HandEyeProblem& from, const HandEyeTransforms& around,
              const PoseChoice& chosen, const std::vector<Matrix6d>& covariances, ceres::LossFunction* loss) {
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (!chosen[i]) continue;
    auto* cost = new HandEyeCost{from.equations().hands[i].inverse(), from.equations().cameras[i], around,
                                 whiteningOf(covariances[i])};
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<HandEyeCost, 6, 6, 6>(cost), loss, blocks.x.data(),
                             blocks.z.data());
  }
  if (from.mount() == HandEyeMount::kIdentity) problem.SetParameterBlockConstant(blocks.x.data());
}

// Inverse of J^T J over these parameter blocks.
Eigen::MatrixXd inverseInformation(ceres::Problem& problem, const std::vector<double*>& blocks) {
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = blocks;
  ceres::CRSMatrix J;
  problem.Evaluate(options, nullptr, nullptr, nullptr, &J);
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(J.num_cols, J.num_cols);
  for (int row = 0; row < J.num_rows; ++row) {
    for (int a = J.rows[row]; a < J.rows[row + 1]; ++a) {
      for (int b = J.rows[row]; b < J.rows[row + 1]; ++b) A(J.cols[a], J.cols[b]) += J.values[a] * J.values[b];
    }
  }
  return inverseOfSymmetric(A);
}

ceres::Problem::Options sharedLoss() {
  ceres::Problem::Options options;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  return options;
}

}  // namespace

double squaredDistance(const Vector6d& residual, const Matrix6d& covariance) {
  return residual.dot(solveSymmetric(covariance, residual));
}

HandEyeProblem::HandEyeProblem(const PoseSet& set, HandEyeMount mount)
    : equations_(handEyeEquations(set)), mount_(mount), setup_(set.setup), hand_std_(set.hand_std) {
  bool camera_known = true, from_points = false;
  about_isocenter_ = true;
  for (const HandEyePose& pose : set.poses) {
    about_isocenter_ = about_isocenter_ && pose.joints.has_value();
    from_points = from_points || pose.points_px.cols() > 0;
    camera_known = camera_known && (pose.covariance || set.camera_std);
    camera_covariances_.push_back(pose.covariance  ? *pose.covariance
                                  : set.camera_std ? isotropic(*set.camera_std)
                                                   : Matrix6d(Matrix6d::Zero()));
  }
  // Scatter of points in one image says nothing of the machine between the images.
  noise_given_ = camera_known && (!from_points || hand_std_);
}

Vector6d HandEyeProblem::residual(std::size_t i, const HandEyeTransforms& t) const {
  const Pose predicted = HandEyeEquations::predicted(equations_.hands[i], t.X, t.Z);
  Vector6d r;
  r << equations_.cameras[i].translation() - predicted.translation(),
      logSO3(equations_.cameras[i].linear() * predicted.linear().transpose());
  return r;
}

Matrix6d HandEyeProblem::handCovariance(std::size_t i, const HandEyeTransforms& t) const {
  if (!hand_std_) return Matrix6d::Zero();
  constexpr double kStep = 1e-6;
  Matrix6d J;  // Of the prediction by a twist of T_base_hand.
  for (int k = 0; k < 6; ++k) {
    Pose ends[2];
    for (int side = 0; side < 2; ++side) {
      const Vector6d twist = (side == 0 ? kStep : -kStep) * Vector6d::Unit(k);
      const bool in_hand = setup_ == HandEyeSetup::kEyeInHand;
      const Pose T_base_hand = in_hand ? equations_.hands[i] : Pose(equations_.hands[i].inverse());
      const Pose moved =
          about_isocenter_ ? Pose(movedBy(Pose::Identity(), twist) * T_base_hand) : movedBy(T_base_hand, twist);
      ends[side] = HandEyeEquations::predicted(in_hand ? moved : Pose(moved.inverse()), t.X, t.Z);
    }
    J.col(k) << ends[0].translation() - ends[1].translation(), logSO3(ends[0].linear() * ends[1].linear().transpose());
  }
  J /= 2 * kStep;
  return J * isotropic(*hand_std_) * J.transpose();
}

std::vector<Matrix6d> HandEyeProblem::covariances(const HandEyeTransforms& t, const PoseSigma& more,
                                                  bool with_camera) const {
  std::vector<Matrix6d> all;
  for (std::size_t i = 0; i < size(); ++i) {
    const Matrix6d camera = with_camera ? camera_covariances_[i] : Matrix6d(Matrix6d::Zero());
    all.push_back(camera + handCovariance(i, t) + isotropic(more) + kMinStd * kMinStd * Matrix6d::Identity());
  }
  return all;
}

HandEyeTransforms HandEyeProblem::solved(const HandEyeTransforms& start, const PoseChoice& chosen,
                                         const std::vector<Matrix6d>& covariances, Loss loss) const {
  HandEyeTransforms now = start;
  ceres::CauchyLoss robust(kRobustScale);
  for (int round = 0; round < kRelinearisations; ++round) {
    ceres::Problem problem(sharedLoss());
    Blocks blocks;
    addPoses(problem, blocks, *this, now, chosen, covariances, loss == Loss::kRobust ? &robust : nullptr);
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.logging_type = ceres::SILENT;
    options.function_tolerance = 1e-12;  // Closer, steps that rounding makes fail would be told on stderr.
    options.parameter_tolerance = 1e-12;
    options.max_num_iterations = 50;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    now.X = movedBy(now.X, blocks.x);
    now.Z = movedBy(now.Z, blocks.z);
    if (blocks.x.norm() + blocks.z.norm() < 1e-9) break;
  }
  return now;
}

Eigen::MatrixXd HandEyeProblem::covarianceOf(const HandEyeTransforms& t, const PoseChoice& chosen,
                                             const std::vector<Matrix6d>& covariances) const {
  ceres::Problem problem(sharedLoss());
  Blocks blocks;
  addPoses(problem, blocks, *this, t, chosen, covariances, nullptr);
  std::vector<double*> free;
  if (mount_ == HandEyeMount::kUnknown) free.push_back(blocks.x.data());
  free.push_back(blocks.z.data());
  return inverseInformation(problem, free);
}

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
      const Eigen::Index free = from.mount() == HandEyeMount::kIdentity ? 6 : 12;
      fit.covariance = inverseInformation(problem, blocks).topLeftCorner(free, free);
    }
    fit.transforms.X = movedBy(fit.transforms.X, x);
    fit.transforms.Z = movedBy(fit.transforms.Z, z);
  }
  return fit;
}

}  // namespace angio::calibration
