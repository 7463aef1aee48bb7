// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/motion_filter.hpp"

#include <Eigen/Cholesky>
#include <cmath>

#include "angio/base/errors.hpp"

namespace angio::registration {
namespace {

// A twist's standard deviations, squared on the diagonal.
Matrix6d diagonal(double translation_mm, double rotation_deg) {
  Vector6d variance;
  variance << Eigen::Vector3d::Constant(std::pow(translation_mm * 1e-3, 2)),
      Eigen::Vector3d::Constant(std::pow(degToRad(rotation_deg), 2));
  return variance.asDiagonal();
}

Matrix6d symmetric(const Matrix6d& C) { return 0.5 * (C + C.transpose()); }

}  // namespace

// R_true = R exp(w) gives dw = R w in camera axes; t_true = T (c + exp(xi)(-c)) gives dt = R (v + c x w).
Matrix6d covarianceOfResult(const Matrix6d& about_centroid, const Pose& T_camera_model,
                            const Eigen::Vector3d& centroid_model) {
  const Eigen::Matrix3d R = T_camera_model.linear();
  Matrix6d J = Matrix6d::Zero();
  J.topLeftCorner<3, 3>() = J.bottomRightCorner<3, 3>() = R;
  J.topRightCorner<3, 3>() = R * skew(centroid_model);
  return symmetric(J * about_centroid * J.transpose());
}

// w = R^T dw, v = R^T dt - c x w.
Matrix6d covarianceAboutCentroid(const Matrix6d& of_result, const Pose& T_camera_model,
                                 const Eigen::Vector3d& centroid_model) {
  const Eigen::Matrix3d Rt = T_camera_model.linear().transpose();
  Matrix6d J = Matrix6d::Zero();
  J.topLeftCorner<3, 3>() = J.bottomRightCorner<3, 3>() = Rt;
  J.topRightCorner<3, 3>() = -skew(centroid_model) * Rt;
  return symmetric(J * of_result * J.transpose());
}

MotionFilter::MotionFilter(const MotionFilterSettings& settings, const Eigen::Vector3d& centroid_model)
    : settings_(settings), centroid_(centroid_model) {
  checkSettings("motion", settings_);
  for (int k = 0; k < 3; ++k) requireFinite("motion", "centroid_m", centroid_[k]);
}

MotionFilter::State MotionFilter::at(double time_s) const {
  requireFinite("motion", "time_s", time_s);
  const double dt = time_s - state_->time_s;
  if (dt < 0)
    throw InputError("motion", "time_s", formatValue(time_s), "must not be before " + formatValue(state_->time_s));
  State next = *state_;
  next.time_s = time_s;
  const Twist moved = state_->velocity * dt;
  next.T_camera_centered = state_->T_camera_centered * expSE3(moved);

  // exp(-V dt) exp(xi) exp((V + nu) dt) = exp(Ad(exp(-V dt)) xi) exp(Jr(V dt) nu dt) to first order.
  Matrix12d F = Matrix12d::Identity();
  F.topLeftCorner<6, 6>() = adjointSE3(expSE3(-moved));
  F.topRightCorner<6, 6>() = dt * rightJacobianInverseSE3(moved).inverse();
  // White acceleration of density q, integrated once and twice. By its density and not by frame, so that one step over
  // two frames is as sure as two steps.
  const Matrix6d q = settings_.acceleration_mean_s *
                     diagonal(settings_.acceleration_std_mm_per_s2, settings_.angular_acceleration_std_deg_per_s2);
  Matrix12d Q;
  Q << q * (dt * dt * dt / 3), q * (dt * dt / 2), q * (dt * dt / 2), q * dt;
  next.covariance = F * state_->covariance * F.transpose() + Q;
  return next;
}

Matrix6d MotionFilter::measured(const Matrix6d& about_centroid) const {
  return symmetric(about_centroid) +
         diagonal(settings_.measured_translation_std_mm, settings_.measured_rotation_std_deg);
}

std::optional<PosePrior> MotionFilter::predict(double time_s) const {
  if (!state_) return std::nullopt;
  const State predicted = at(time_s);
  return PosePrior{predicted.T_camera_centered * Eigen::Translation3d(-centroid_),
                   symmetric(predicted.covariance.topLeftCorner<6, 6>())};
}

Innovation MotionFilter::innovation(const State& predicted, const Pose& T_camera_model,
                                    const Matrix6d& about_centroid) const {
  Innovation result;
  result.xi = logSE3(predicted.T_camera_centered.inverse() * T_camera_model * Eigen::Translation3d(centroid_));
  const Matrix6d S = predicted.covariance.topLeftCorner<6, 6>() + measured(about_centroid);
  result.squared_mahalanobis = result.xi.dot(S.ldlt().solve(result.xi));
  return result;
}

std::optional<Innovation> MotionFilter::innovation(const Pose& T_camera_model, const Matrix6d& about_centroid,
                                                   double time_s) const {
  if (!state_) return std::nullopt;
  return innovation(at(time_s), T_camera_model, about_centroid);
}

std::optional<Innovation> MotionFilter::update(const Pose& T_camera_model, const Matrix6d& about_centroid,
                                               double time_s) {
  requireFinite("motion", "time_s", time_s);
  if (!(rotationDefect(T_camera_model.linear()) < 1e-6) || !T_camera_model.translation().allFinite())
    throw InputError("motion", "T_camera_model", "", "must be a finite rigid transform");
  if (!about_centroid.allFinite()) throw InputError("motion", "covariance", "", "must be finite");
  const Matrix6d R = measured(about_centroid);
  if (!state_) {
    state_ = State();
    state_->time_s = time_s;
    state_->T_camera_centered = T_camera_model * Eigen::Translation3d(centroid_);
    state_->covariance.topLeftCorner<6, 6>() = R;
    state_->covariance.bottomRightCorner<6, 6>() =
        diagonal(settings_.first_speed_std_mm_per_s, settings_.first_angular_speed_std_deg_per_s);
    return std::nullopt;
  }
  State next = at(time_s);
  const Innovation seen = innovation(next, T_camera_model, about_centroid);
  const Matrix6d S = next.covariance.topLeftCorner<6, 6>() + R;
  const Eigen::Matrix<double, 12, 6> K =
      S.ldlt().solve(next.covariance.topRows<6>()).transpose();  // P H^T S^-1, H = [I 0].
  const Eigen::Matrix<double, 12, 1> correction = K * seen.xi;
  // Joseph's form stays positive. That xi and the measurement's noise live in axes turned by the innovation against
  // each other is second order: an innovation inside the gate is a few degrees.
  Matrix12d A = Matrix12d::Identity();
  A.leftCols<6>() -= K;
  next.covariance = Matrix12d(A * next.covariance * A.transpose() + K * R * K.transpose());
  next.T_camera_centered = next.T_camera_centered * expSE3(correction.head<6>());
  next.T_camera_centered.linear() = nearestRotation(next.T_camera_centered.linear());
  next.velocity += correction.tail<6>();
  state_ = next;
  return seen;
}

}  // namespace angio::registration
