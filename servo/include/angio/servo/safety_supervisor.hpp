// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "angio/servo/message_timing_monitor.hpp"
#include "angio/servo/motion_monitor.hpp"
#include "angio/servo/namespace.hpp"
#include "angio/servo/servo_state_machine.hpp"
#include "angio/types/any_message.hpp"

namespace angio::servo {

/// Whether a command's velocities are finite numbers.
inline bool isFinite(const CArmCommand& command) { return command.velocity.allFinite(); }
inline bool isFinite(const CatheterCommand& command) {
  return std::isfinite(command.insertion_speed_m_per_s) && std::isfinite(command.roll_speed_rad_per_s) &&
         std::isfinite(command.bend_speed_rad_per_s);
}

/// Returns the same command, standing still.
inline CArmCommand atRest(CArmCommand command) {
  command.velocity.setZero();
  return command;
}
inline CatheterCommand atRest(CatheterCommand command) {
  command.insertion_speed_m_per_s = command.roll_speed_rad_per_s = command.bend_speed_rad_per_s = 0;
  command.valid_for_us = 1;  // Nothing is obeyed for longer than it takes to read it.
  return command;
}

/// What is supervised of every machine.
struct SupervisionSettings {
  ServoStateSettings states;
  MessageTimingSettings freshness;
  double max_start_spread_deg = 1;
  double max_start_spread_mm = 5;
  double max_start_spread_depth_mm = 30;

  void visit(SettingsVisitor& v) {
    v.section("states", [this](SettingsVisitor& inner) { states.visit(inner); });
    v.section("freshness", [this](SettingsVisitor& inner) { freshness.visit(inner); });
    v.number("max_start_spread_deg", max_start_spread_deg, 0.01, 180,
             "Largest turn between the patient's poses in consecutive frames, until the machine moves");
    v.number("max_start_spread_mm", max_start_spread_mm, 0.01, 1000,
             "Largest shift of the target between consecutive frames across the beam, until the machine moves");
    v.number("max_start_spread_depth_mm", max_start_spread_depth_mm, 0.01, 1000,
             "Largest shift of the target between consecutive frames along the beam, until the machine moves: one view "
             "sees depth poorly, above all of a deformed tree");
  }
};

/// The same of a C-arm, with its motion.
struct SafetySettings : SupervisionSettings {
  MotionMonitorSettings motion;

  void visit(SettingsVisitor& v) {
    SupervisionSettings::visit(v);
    v.section("motion", [this](SettingsVisitor& inner) { motion.visit(inner); });
  }
};

/// What SafetySupervisor decides whatever the machine is: its state machine, the timing and plausibility of frames and
/// joints, and the agreement of the first registrations.
class FrameSupervisor {
 public:
  using RejectionKind = ServoStateMachine::RejectionKind;

  /// @param limits        Of the C-arm that holds the camera.
  /// @param target_model  The point whose place matters, in the model frame [m].
  /// Throws InputError when a setting is out of its range.
  FrameSupervisor(const SupervisionSettings& settings, const CArmLimits& limits, const Eigen::Vector3d& target_model);

  /// Why a frame must not be used; nothing when it may be looked at.
  /// @param sender  As the bus names it, here and below; empty: unknown.
  std::optional<std::string> begin(const XrayFrame& frame, std::int64_t now_us, const std::string& sender = {});

  /// The frame's registration may move the machine.
  ///
  /// @param T_patient_model  The model in the patient frame, as this frame's registration and its joints say.
  /// @param beam_patient     The beam's direction there, a unit vector.
  void accept(const Pose& T_patient_model, const Eigen::Vector3d& beam_patient, std::int64_t now_us);
  void reject(RejectionKind kind, const std::string& reason, std::int64_t now_us);
  void wait(std::int64_t now_us, const std::function<std::string()>& silence = {}) { states_.wait(now_us, silence); }

  /// Another program speaks where one must: a fault.
  void secondSender(const std::string& how, std::int64_t now_us) { fault(ServoCause::kSecondSender, how, now_us); }

  const ServoStateMachine& states() const { return states_; }
  bool moves() const { return states_.moves(); }

  /// Fills in state, its reason, and how and when it came about.
  void describe(ServoStatus& status) const { states_.describe(status); }

 protected:
  /// What a request changed beside the state.
  struct Requested {
    std::optional<std::string> refused;
    bool armed = false, reset = false;
  };
  Requested obey(const ServoRequest& request, std::int64_t now_us);

  /// Whether a state may be used; a fault is raised where it says what cannot be. No frame is looked at until a sound
  /// state of the C-arm has followed.
  bool sound(const CArmState& newest, std::int64_t now_us, const std::string& sender);
  bool sound(const CatheterState& newest, std::int64_t now_us, const std::string& sender);
  void fault(ServoCause cause, const std::string& reason, std::int64_t now_us) { states_.fault(cause, reason, now_us); }

 private:
  std::optional<std::string> raise(const Rejection& rejection, std::int64_t now_us);

  SupervisionSettings settings_;
  Eigen::Vector3d target_;
  ServoStateMachine states_;
  MessageTimingMonitor timing_;
  std::optional<Pose> last_T_patient_model_;
  std::optional<std::string> unsound_arm_;  // What is wrong with the newest joints.
};

/// Decides whether a machine may move: the state machine, fed by what is heard, observed and commanded. `Monitor`
/// compares the machine's motion with its commands (MotionMonitor, DriveMonitor). A node calls, in order:
///
///   request()    for each of the operator's requests;
///   observe()    for each state of the C-arm, and of the machine;
///   begin()      for each frame, before it is used; a frame that it rejects must not be used;
///   accept() or reject() once per frame that begin() let pass, by what the registration is worth;
///   permits()    on the command that is proposed; commanded() with the command as it was sent;
///   wait()       when no frame came.
///
/// All times `now_us` are the caller's own clock [us]. The same calls give the same answers.
template <typename Monitor>
class SafetySupervisor : public FrameSupervisor {
 public:
  using State = typename Monitor::State;
  using Command = typename Monitor::Command;

  SafetySupervisor(const SupervisionSettings& settings, const CArmLimits& limits, const Eigen::Vector3d& target_model,
                   Monitor monitor)
      : FrameSupervisor(settings, limits, target_model), monitor_(std::move(monitor)) {}

  /// Returns why the request was refused; nothing when it was obeyed. A reset forgets what was known of all senders.
  std::optional<std::string> request(const ServoRequest& request, std::int64_t now_us) {
    const Requested requested = obey(request, now_us);
    // A machine that was moved by hand is no fault of what comes next.
    if (requested.armed || requested.reset) monitor_.forget();
    return requested.refused;
  }

  /// The newest state of the C-arm that holds the camera.
  void observe(const CArmState& newest, std::int64_t now_us, const std::string& sender = {}) {
    const bool usable = sound(newest, now_us, sender);
    if constexpr (std::is_same_v<State, CArmState>) compare(usable, newest, now_us);
  }

  /// The newest state of a machine that is not the C-arm.
  template <typename Other, std::enable_if_t<!std::is_same_v<Other, CArmState>, int> = 0>
  void observe(const Other& newest, std::int64_t now_us, const std::string& sender = {}) {
    static_assert(std::is_same_v<Other, State>);
    compare(sound(newest, now_us, sender), newest, now_us);
  }

  /// Whether a command may be sent as it is: only in SERVO, and only finite numbers.
  bool permits(const Command& command) const { return moves() && isFinite(command); }

  /// Has to hear of every command, also of those that stand still.
  void commanded(const Command& command) { monitor_.commanded(command); }

 private:
  void compare(bool usable, const State& newest, std::int64_t now_us) {
    if (!usable) return;
    if (const auto astray = monitor_.measured(newest)) fault(ServoCause::kMotionDisagrees, *astray, now_us);
  }

  Monitor monitor_;
};

}  // namespace angio::servo
