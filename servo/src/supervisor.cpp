// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/supervisor.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/robot/carm_limiter.hpp"

namespace angio {
namespace {

// Standard deviation of T * target in its worst direction [m]: d(T p) = dt - (R p)^ dw for the covariance of (t,
// rotation).
double worstTargetStd(const RegistrationResult& seen, const Eigen::Vector3d& target) {
  Eigen::Matrix<double, 3, 6> J;
  J << Eigen::Matrix3d::Identity(), -skew(seen.T_camera_model.linear() * target);
  const Eigen::Matrix3d covariance = J * *seen.covariance * J.transpose();
  return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvalues()[2]));
}

std::string over(const char* what, double value, double most, const char* unit) {
  return std::string(what) + " " + shown(value) + " " + unit + " exceeds " + shown(most) + " " + unit;
}

}  // namespace

Supervisor::Supervisor(const SupervisorSettings& settings, const CArmLimits& limits,
                       const Eigen::Vector3d& target_model)
    : settings_(settings), limits_(limits), target_(target_model) {
  checkSettings("supervisor", settings_);
}

std::optional<std::string> Supervisor::objection(const XrayFrame& frame, const CArmState& state) const {
  const int type = frame.image.type();
  if (frame.image.empty() || (type != CV_8UC1 && type != CV_16UC1)) return "the frame has no image of 8 or 16 bit";
  if (frame.image.cols != frame.camera.width_px() || frame.image.rows != frame.camera.height_px()) {
    return "the frame's image is not of its camera's size";
  }
  if (!state.joints.allFinite() || !state.velocity.allFinite()) return "joints are not finite";
  const double age_ms = std::abs(static_cast<double>(frame.time_us) - static_cast<double>(state.time_us)) * 1e-3;
  if (!(age_ms <= settings_.most_state_age_ms))
    return over("age of the joints", age_ms, settings_.most_state_age_ms, "ms");
  return std::nullopt;
}

std::optional<std::string> Supervisor::objection(const RegistrationResult& seen, const PosePrior& predicted,
                                                 bool tracking) const {
  if (seen.status != RegistrationStatus::kConverged)
    return "registration " + statusName(seen.status) + ": " + seen.reason;
  if (!seen.T_camera_model.matrix().allFinite() || !seen.covariance || !seen.covariance->allFinite()) {
    return "registration is not finite";
  }
  const double turned_deg =
      radToDeg(rotationAngle(seen.T_camera_model.linear() * predicted.T_camera_model.linear().transpose()));
  const double moved_mm = 1e3 * (seen.T_camera_model * target_ - predicted.T_camera_model * target_).norm();
  const double most_deg = tracking ? settings_.most_jump_deg : settings_.most_correction_deg;
  const double most_mm = tracking ? settings_.most_jump_mm : settings_.most_correction_mm;
  if (!(turned_deg <= most_deg)) return over("turn against the prediction", turned_deg, most_deg, "deg");
  if (!(moved_mm <= most_mm)) return over("shift against the prediction", moved_mm, most_mm, "mm");
  const double std_mm = 1e3 * worstTargetStd(seen, target_);
  if (!(std_mm <= settings_.most_target_std_mm)) {
    return over("uncertainty of the target", std_mm, settings_.most_target_std_mm, "mm");
  }
  return std::nullopt;
}

CArmJoints Supervisor::limit(const CArmJoints& wanted, const CArmJoints& last_command, const CArmState& state,
                             double period_s) const {
  return limited(wanted, last_command, state.joints, limits_, period_s);
}

std::int64_t Supervisor::commandValidity_us() const { return std::llround(settings_.command_valid_ms * 1e3); }

}  // namespace angio
