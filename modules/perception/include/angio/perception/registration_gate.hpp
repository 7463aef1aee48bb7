// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>

#include "angio/perception/patient_observation.hpp"
#include "angio/perception/target_need.hpp"
#include "angio/registration/registration.hpp"
#include "angio/types/any_message.hpp"

namespace angio::perception {

/// Bounds on what a registration may say before it moves a machine. Every bound that is exceeded ends in a hold.
struct RegistrationGateSettings {
  double max_state_age_ms = 200;
  double max_calibration_offset_deg = 12;
  double max_calibration_offset_mm = 40;
  double max_innovation_deg = 2.5;
  double max_innovation_mm = 10;
  double max_innovation_depth_mm = 30;
  double max_target_std_mm = 3;
  double command_valid_ms = 200;

  std::int64_t commandValidity_us() const { return std::llround(command_valid_ms * 1e3); }

  void visit(SettingsVisitor& v) {
    v.number("max_state_age_ms", max_state_age_ms, 1, 10000,
             "Largest time between a frame and the joints it is read with");
    v.number("max_calibration_offset_deg", max_calibration_offset_deg, 0.01, 180,
             "Largest rotation between registration and calibration: a creeping error ends here");
    v.number("max_calibration_offset_mm", max_calibration_offset_mm, 0.01, 1000,
             "Largest shift between registration and calibration: a creeping error ends here");
    v.number("max_innovation_deg", max_innovation_deg, 0.01, 180,
             "Largest rotation between registration and prediction while tracking");
    v.number("max_innovation_mm", max_innovation_mm, 0.01, 1000,
             "Largest shift between registration and prediction while tracking, across the beam");
    v.number("max_innovation_depth_mm", max_innovation_depth_mm, 0.01, 1000,
             "Largest shift between registration and prediction while tracking, along the beam: one view sees depth "
             "poorly, above all of a tree that deforms");
    v.number("max_target_std_mm", max_target_std_mm, 1e-3, 1000,
             "Standard deviation of the target, in the worst direction that the task needs");
    v.number("command_valid_ms", command_valid_ms, 10, 1000,
             "How long a C-arm's command may be obeyed: three frames at 15 a second");
  }
};

/// Decides whether a frame's registration may move a machine.
class RegistrationGate {
 public:
  /// @param target_model  The point whose place matters [m].
  /// @param need          The directions in which it matters.
  RegistrationGate(const RegistrationGateSettings& settings, const Eigen::Vector3d& target_model,
                   TargetNeed need = TargetNeed::kEverywhere);

  /// Why a frame must not be read with these joints; nothing when it may.
  std::optional<std::string> rejection(const XrayFrame& frame, const CArmState& state) const;

  /// Why a registration must not move the machine; nothing when it may.
  ///
  /// @param calibrated  Pose of the model by joints and calibration alone.
  /// @param predicted   Pose by joints and what was tracked; nothing while nothing is.
  std::optional<std::string> rejection(const RegistrationResult& seen, const Pose& calibrated,
                                       const std::optional<Pose>& predicted) const;

  /// The first half of it: why a registration cannot be right; nothing when it can.
  std::optional<std::string> contradiction(const RegistrationResult& seen, const Pose& calibrated,
                                           const std::optional<Pose>& predicted) const;

  /// What of the first half does not ask for the status: why a registration is not where the tree can be.
  std::optional<std::string> misplaced(const RegistrationResult& seen, const Pose& calibrated,
                                       const std::optional<Pose>& predicted) const;

  /// The second half: why what is right does not say enough of the target; nothing when it does.
  std::optional<std::string> tooUnsure(const PatientObservation& patient) const;

  /// Whether a standard deviation of the target is as small as any task asks for.
  bool sureEnough(double std_m) const { return 1e3 * std_m <= settings_.max_target_std_mm; }

 private:
  std::optional<std::string> tooFar(const Pose& seen, const Pose& expected, double max_deg, double max_mm,
                                    double max_depth_mm, const char* what) const;

  RegistrationGateSettings settings_;
  Eigen::Vector3d target_;
  TargetNeed need_;
};

}  // namespace angio::perception
