// SPDX-License-Identifier: GPL-2.0-or-later
#include "distance_costs.hpp"

#include <algorithm>
#include <cmath>

#include "angio/geometry/decompositions.hpp"

namespace angio::registration {
namespace {

using RotationBlock = Eigen::Matrix<double, 9, 1>;
template <int Rows, int Columns>
using RowMajorMap = Eigen::Map<Eigen::Matrix<double, Rows, Columns, Eigen::RowMajor>>;

// A point nearer to the source than this has no image that a step could be made by [m].
constexpr double kMinDepth_m = 1e-3;

Pose poseAt(const double* block) { return poseOf(Eigen::Map<const PoseBlock>(block)); }

// Both of dx = [v; w]: those of T exp(.) in model axes from those in camera axes.
Matrix6d modelFromCameraAxes(const Pose& T) {
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = T.linear().transpose();
  return turn;
}

}  // namespace

PoseBlock blockOf(const Pose& T_camera_centered) {
  PoseBlock block;
  const Eigen::Matrix3d R = T_camera_centered.linear();
  block << Eigen::Map<const RotationBlock>(R.data()), T_camera_centered.translation();
  return block;
}

Pose poseOf(const PoseBlock& block) {
  Pose T = Pose::Identity();
  T.linear() = Eigen::Map<const Eigen::Matrix3d>(block.data());
  T.translation() = block.tail<3>();
  return T;
}

bool PoseManifold::Plus(const double* x, const double* dx, double* x_plus_dx) const {
  Pose T = poseAt(x);
  const Pose step = expSE3(Eigen::Map<const Twist>(dx));
  T.linear() = step.linear() * T.linear();
  T.translation() += step.translation();
  Eigen::Map<PoseBlock>{x_plus_dx} = blockOf(T);
  return true;
}

bool PoseManifold::PlusJacobian(const double* x, double* jacobian) const {
  RowMajorMap<12, 6> J(jacobian);
  J.setZero();
  const Pose T = poseAt(x);
  for (int column = 0; column < 3; ++column) J.block<3, 3>(3 * column, 3) = -skew(T.linear().col(column));
  J.bottomLeftCorner<3, 3>().setIdentity();
  return true;
}

bool PoseManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  const Pose T_y = poseAt(y), T_x = poseAt(x);
  Pose step = Pose::Identity();
  step.linear() = nearestRotation(T_y.linear() * T_x.linear().transpose());
  step.translation() = T_y.translation() - T_x.translation();
  Eigen::Map<Twist>{y_minus_x} = logSE3(step);
  return true;
}

bool PoseManifold::MinusJacobian(const double* x, double* jacobian) const {
  // exp(w) = Y R^T: w is half of what is antisymmetric in dY R^T, to first order.
  RowMajorMap<6, 12> J(jacobian);
  J.setZero();
  const Pose T = poseAt(x);
  for (int column = 0; column < 3; ++column) J.block<3, 3>(3, 3 * column) = 0.5 * skew(T.linear().col(column));
  J.topRightCorner<3, 3>().setIdentity();
  return true;
}

bool DistanceResidual::evaluate(const Eigen::Vector3d& p_view, double* residual_px,
                                Eigen::RowVector3d* gradient) const {
  if (!(p_view.z() > kMinDepth_m)) return false;
  Eigen::Matrix<double, 2, 3> J;
  const auto pixel = camera_->project(p_view, gradient ? &J : nullptr);
  const DistanceField::Sample sample = field_->at(*pixel);
  double rho[3];
  loss_->Evaluate(sample.squared_px2 + kSoft_px * kSoft_px, rho);
  *residual_px = std::sqrt(rho[0]);
  if (gradient) *gradient = 0.5 * rho[1] / *residual_px * (sample.gradient_px.transpose() * J);
  return true;
}

bool DistanceResidual::across(const Eigen::Vector3d& p_view, double* weight, double* square_px2,
                              Eigen::RowVector3d* row) const {
  if (!(p_view.z() > kMinDepth_m)) return false;
  Eigen::Matrix<double, 2, 3> J;
  const DistanceField::Sample sample = field_->at(*camera_->project(p_view, &J));
  const double slope = sample.gradient_px.norm();
  if (!(slope > 0)) return false;
  double rho[3];
  loss_->Evaluate(sample.squared_px2, rho);
  *weight = rho[1];
  *square_px2 = rho[1] * sample.squared_px2;
  *row = std::sqrt(rho[1]) / slope * (sample.gradient_px.transpose() * J);
  return true;
}

TreeDistanceCost::TreeDistanceCost(const Eigen::Matrix3Xd& points_centered, const DistanceField& field,
                                   const XrayView& view, const ceres::LossFunction& loss)
    : points_(points_centered), distance_(field, view.camera, loss), T_view_first_(view.T_view_first) {
  set_num_residuals(static_cast<int>(points_.cols()));
  *mutable_parameter_block_sizes() = {12, 6};
}

bool TreeDistanceCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Pose T = poseAt(parameters[0]);
  const double* e = parameters[1];
  Eigen::Matrix3d stretch;
  stretch << 1 + e[0], e[3], e[4], e[3], 1 + e[1], e[5], e[4], e[5], 1 + e[2];
  const Pose T_view = T_view_first_ * T;
  const Eigen::Matrix3d R_view_first = T_view_first_.linear(), R = T.linear();
  double* of_pose = jacobians ? jacobians[0] : nullptr;
  double* of_strain = jacobians ? jacobians[1] : nullptr;
  const bool wanted = of_pose || of_strain;
  for (Eigen::Index i = 0; i < points_.cols(); ++i) {
    const Eigen::Vector3d q = points_.col(i), stretched = stretch * q;
    Eigen::RowVector3d gradient;
    if (!distance_.evaluate(T_view * stretched, &residuals[i], wanted ? &gradient : nullptr)) return false;
    if (!wanted) continue;
    const Eigen::RowVector3d of_camera = gradient * R_view_first;  // With respect to the point.
    if (of_pose) {
      Eigen::Map<Eigen::Matrix<double, 1, 12, Eigen::RowMajor>> row(of_pose + 12 * i);
      row << stretched.x() * of_camera, stretched.y() * of_camera, stretched.z() * of_camera, of_camera;
    }
    if (of_strain) {
      const Eigen::RowVector3d h = of_camera * R;
      Eigen::Map<Eigen::Matrix<double, 1, 6, Eigen::RowMajor>> row(of_strain + 6 * i);
      row << h.x() * q.x(), h.y() * q.y(), h.z() * q.z(), h.x() * q.y() + h.y() * q.x(), h.x() * q.z() + h.z() * q.x(),
          h.y() * q.z() + h.z() * q.y();
    }
  }
  return true;
}

void TreeDistanceCost::addInformation(const Pose& T_camera_centered, Matrix6d& H, double& weights,
                                      double& squares_px2) const {
  const Pose T_view = T_view_first_ * T_camera_centered;
  const Eigen::Matrix3d R = T_camera_centered.linear(), R_view_first = T_view_first_.linear();
  for (Eigen::Index i = 0; i < points_.cols(); ++i) {
    double weight = 0, square_px2 = 0;
    Eigen::RowVector3d row;
    if (!distance_.across(T_view * points_.col(i), &weight, &square_px2, &row)) continue;
    const Eigen::Vector3d turned = R * points_.col(i), of_camera = (row * R_view_first).transpose();
    Vector6d J;
    J << of_camera, turned.cross(of_camera);
    H += J * J.transpose();
    weights += weight;
    squares_px2 += square_px2;
  }
}

bool StrainCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const double scale = std::sqrt(weight_px2_);
  if (jacobians && jacobians[0]) std::fill_n(jacobians[0], 36, 0.0);
  for (int k = 0; k < 6; ++k) {
    const double slope = k < 3 ? scale : std::sqrt(2.0) * scale;  // What is off the diagonal stands in E twice.
    residuals[k] = slope * parameters[0][k];
    if (jacobians && jacobians[0]) jacobians[0][7 * k] = slope;
  }
  return true;
}

StartCost::StartCost(const PosePriorTerm& prior)
    : T_centered_camera0_(prior.T0_camera_centered.inverse()),
      sqrt_information_(lowerFactorOf(prior.information).transpose()) {}

bool StartCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  Pose T = poseAt(parameters[0]);
  const Twist xi = logSE3(T_centered_camera0_ * T);
  Eigen::Map<Vector6d>{residuals} = sqrt_information_ * xi;
  if (jacobians && jacobians[0]) {
    Eigen::Matrix<double, 6, 12, Eigen::RowMajor> of_block;
    PoseManifold().MinusJacobian(parameters[0], of_block.data());
    RowMajorMap<6, 12>{jacobians[0]} =
        sqrt_information_ * rightJacobianInverseSE3(xi) * modelFromCameraAxes(T) * of_block;
  }
  return true;
}

}  // namespace angio::registration
