// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/servo/freshness_gate.hpp"
#include "angio/servo/motion_monitor.hpp"
#include "angio/servo/servo_state_machine.hpp"

namespace angio {

struct SafetySettings {
  ServoStateSettings states;
  FreshnessSettings freshness;
  MotionMonitorSettings motion;
  double most_start_spread_deg = 1;  ///< Between the patient's poses in consecutive frames, until the machine moves.
  double most_start_spread_mm = 5;   ///< Of the target, across the beam.
  double most_start_spread_depth_mm = 30;  ///< Along it: one view sees depth poorly, above all of a tree that bends.

  void visit(SettingsVisitor& v) {
    v.section("states", [this](SettingsVisitor& inner) { states.visit(inner); });
    v.section("freshness", [this](SettingsVisitor& inner) { freshness.visit(inner); });
    v.section("motion", [this](SettingsVisitor& inner) { motion.visit(inner); });
    v.number("most_start_spread_deg", most_start_spread_deg, 0.01, 180);
    v.number("most_start_spread_mm", most_start_spread_mm, 0.01, 1000);
    v.number("most_start_spread_depth_mm", most_start_spread_depth_mm, 0.01, 1000);
  }
};

/// Whether the machine may move: the state machine, fed by what is heard, seen and commanded. A loop calls, in order:
///
///   request()    for each of the operator's requests;
///   observe()    for each state of the joints;
///   begin()      for each frame, before anything is made of it; what it objects to must not be looked at;
///   trust() or doubt()   once per frame that begin() let pass, by what the registration is worth;
///   permitted()  on the velocity that goes out; commanded() with the command as it was sent;
///   wait()       when no frame came.
///
/// All times `now_us` are the caller's own clock [us]. The same calls give the same answers.
class SafetySupervisor {
 public:
  using Doubt = ServoStateMachine::Doubt;

  /// @param target_model  The point whose place matters, in the model frame [m]. Throws InputError when a setting is
  /// out of its range.
  SafetySupervisor(const SafetySettings& settings, const CArmLimits& limits, const Eigen::Vector3d& target_model);

  /// Returns why the request was refused; nothing when it was obeyed. A reset forgets what was known of all senders.
  std::optional<std::string> request(const ServoRequest& request, std::int64_t now_us);

  void observe(const CArmState& newest, std::int64_t now_us);

  /// Why a frame must not be used; nothing when it may be looked at.
  std::optional<std::string> begin(const XrayFrame& frame, std::int64_t now_us);

  /// @param T_patient_model  The model in the patient frame, as this frame's registration and its joints say.
  /// @param beam_patient     The beam's direction there, a unit vector.
  void trust(const Pose& T_patient_model, const Eigen::Vector3d& beam_patient, std::int64_t now_us);
  void doubt(Doubt kind, const std::string& reason, std::int64_t now_us);
  void wait(std::int64_t now_us);

  /// The velocity in SERVO; zero in every other state, and when a number is not finite.
  CArmJoints permitted(const CArmJoints& velocity) const;

  /// Has to hear of every command, also of those that stand still.
  void commanded(const CArmCommand& command) { motion_.commanded(command); }

  const ServoStateMachine& states() const { return states_; }
  bool moves() const { return states_.moves(); }

  /// Fills in state, its reason, and how and when it came about.
  void describe(ServoStatus& status) const { states_.describe(status); }

 private:
  std::optional<std::string> raise(const Objection& objection, std::int64_t now_us);

  SafetySettings settings_;
  Eigen::Vector3d target_;
  ServoStateMachine states_;
  FreshnessGate freshness_;
  MotionMonitor motion_;
  std::optional<Pose> last_T_patient_model_;
};

}  // namespace angio
