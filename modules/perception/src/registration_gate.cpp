// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/registration_gate.hpp"

#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/types/channels.hpp"
#include "angio/types/time_stamp.hpp"

namespace angio::perception {
namespace {

const RegistrationGateSettings& checked(const RegistrationGateSettings& settings) {
  checkSettings("supervisor", settings);
  return settings;
}

std::string over(const std::string& what, double value, double most) {
  return what + " " + formatValue(value) + " exceeds " + formatValue(most);
}

}  // namespace

RegistrationGate::RegistrationGate(const RegistrationGateSettings& settings, const Eigen::Vector3d& target_model,
                                   TargetNeed need)
    : settings_(checked(settings)), target_(target_model), need_(need) {}

std::optional<std::string> RegistrationGate::rejection(const XrayFrame& frame, const CArmState& state) const {
  const int type = frame.image.type();
  if (frame.image.empty() || (type != CV_8UC1 && type != CV_16UC1)) return "the frame has no image of 8 or 16 bit";
  if (frame.image.cols != frame.camera.width_px() || frame.image.rows != frame.camera.height_px()) {
    return "the frame's image is not of its camera's size";
  }
  if (!state.joints.allFinite() || !state.velocity.allFinite()) return "joints are not finite";
  const double age_ms = std::abs(static_cast<double>(frame.time_us) - static_cast<double>(state.time_us)) * 1e-3;
  if (auto far = differentEpochs({kXrayFrameChannel, "", frame.time_us}, {kCArmStateChannel, "", state.time_us})) {
    return far;
  }
  if (!(age_ms <= settings_.max_state_age_ms)) {
    return over("age of the joints [ms]", age_ms, settings_.max_state_age_ms);
  }
  return std::nullopt;
}

std::optional<std::string> RegistrationGate::rejection(const RegistrationResult& seen, const Pose& calibrated,
                                                       const std::optional<Pose>& predicted) const {
  if (const auto why = contradiction(seen, calibrated, predicted)) return why;
  return tooUnsure(PatientObservation::of(seen));
}

std::optional<std::string> RegistrationGate::contradiction(const RegistrationResult& seen, const Pose& calibrated,
                                                           const std::optional<Pose>& predicted) const {
  if (seen.status != RegistrationStatus::kConverged) {
    return "registration " + statusName(seen.status) + ": " + seen.reason;
  }
  return misplaced(seen, calibrated, predicted);
}

std::optional<std::string> RegistrationGate::misplaced(const RegistrationResult& seen, const Pose& calibrated,
                                                       const std::optional<Pose>& predicted) const {
  if (!seen.T_camera_model.matrix().allFinite() || !seen.covariance || !seen.covariance->allFinite()) {
    return "registration is not finite";
  }
  if (const auto far =
          tooFar(seen.T_camera_model, calibrated, settings_.max_calibration_offset_deg,
                 settings_.max_calibration_offset_mm, settings_.max_calibration_offset_mm, "calibration")) {
    return far;
  }
  if (predicted) {
    if (const auto far = tooFar(seen.T_camera_model, *predicted, settings_.max_innovation_deg,
                                settings_.max_innovation_mm, settings_.max_innovation_depth_mm, "prediction")) {
      return far;
    }
  }
  return std::nullopt;
}

std::optional<std::string> RegistrationGate::tooUnsure(const PatientObservation& patient) const {
  const double std_mm =
      1e3 * (need_ == TargetNeed::kEverywhere ? patient.worstStd_m(target_) : patient.worstStdAcross_m(target_));
  if (!(std_mm <= settings_.max_target_std_mm)) {
    const double across_mm = 1e3 * patient.worstStdAcross_m(target_);
    if (across_mm <= settings_.max_target_std_mm) {
      return formatted(
          "uncertainty of the target is %.1f mm across the beam and %.1f mm in its worst direction, of %g mm "
          "allowed: centre and navigate may go on, view and hold may not; resolve_depth turns the arm for it",
          across_mm, std_mm, settings_.max_target_std_mm);
    }
    return over("uncertainty of the target [mm]", std_mm, settings_.max_target_std_mm);
  }
  return std::nullopt;
}

std::optional<std::string> RegistrationGate::tooFar(const Pose& seen, const Pose& expected, double max_deg,
                                                    double max_mm, double max_depth_mm, const char* what) const {
  const double turned_deg = radToDeg(rotationAngle(seen.linear() * expected.linear().transpose()));
  const Eigen::Vector3d moved_mm = 1e3 * (seen * target_ - expected * target_);
  const double across_mm = moved_mm.head<2>().norm(), along_mm = std::abs(moved_mm.z());
  if (!(turned_deg <= max_deg)) return over(std::string("turn against the ") + what + " [deg]", turned_deg, max_deg);
  if (!(across_mm <= max_mm)) return over(std::string("shift against the ") + what + " [mm]", across_mm, max_mm);
  if (!(along_mm <= max_depth_mm)) {
    return over(std::string("depth against the ") + what + " [mm]", along_mm, max_depth_mm);
  }
  return std::nullopt;
}

}  // namespace angio::perception
