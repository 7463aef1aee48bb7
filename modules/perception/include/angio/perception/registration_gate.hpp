// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>

#include "angio/geometry/carm.hpp"
#include "angio/messaging/messages.hpp"
#include "angio/perception/target_need.hpp"
#include "angio/registration/registration.hpp"

namespace angio {

/// Bounds on what a registration may say before it moves a machine. Every bound that is exceeded ends in a hold.
struct RegistrationGateSettings {
  double most_state_age_ms = 200;   ///< Between the frame and the joints it is read with.
  double most_correction_deg = 12;  ///< Largest disagreement with the calibration: a creeping error ends here.
  double most_correction_mm = 40;
  double most_jump_deg = 2.5;      ///< Largest disagreement with the prediction while tracking.
  double most_jump_mm = 10;        ///< Across the beam.
  double most_jump_depth_mm = 30;  ///< Along it: one view sees depth poorly, above all of a tree that bends.
  double most_target_std_mm = 3;   ///< Standard deviation of the target, in the worst direction that the task needs.
  double command_valid_ms = 200;   ///< How long a C-arm's command may be obeyed: three frames at 15 a second.

  std::int64_t commandValidity_us() const { return std::llround(command_valid_ms * 1e3); }

  void visit(SettingsVisitor& v) {
    v.number("most_state_age_ms", most_state_age_ms, 1, 10000);
    v.number("most_correction_deg", most_correction_deg, 0.01, 180);
    v.number("most_correction_mm", most_correction_mm, 0.01, 1000);
    v.number("most_jump_deg", most_jump_deg, 0.01, 180);
    v.number("most_jump_mm", most_jump_mm, 0.01, 1000);
    v.number("most_jump_depth_mm", most_jump_depth_mm, 0.01, 1000);
    v.number("most_target_std_mm", most_target_std_mm, 1e-3, 1000);
    v.number("command_valid_ms", command_valid_ms, 10, 1000);
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

 private:
  std::optional<std::string> tooFar(const Pose& seen, const Pose& expected, double most_deg, double most_mm,
                                    double most_depth_mm, const char* what) const;

  RegistrationGateSettings settings_;
  Eigen::Vector3d target_;
  TargetNeed need_;
};

}  // namespace angio
