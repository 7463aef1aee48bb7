// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string>

#include "angio/base/settings.hpp"
#include "angio/servo/namespace.hpp"
#include "angio/types/servo_request.hpp"
#include "angio/types/servo_status.hpp"

namespace angio::servo {

/// What may change the loop's state.
enum class ServoEvent {
  kStop,  ///< The operator's, as the next four.
  kArm,
  kStart,
  kReset,
  kEmergencyStop,
  kAccepted,  ///< As many accepted frames in a row as are wanted.
  kRejected,  ///< A frame that must not move anything, or none for a moment.
  kFault,
};
constexpr int kServoEventCount = 8;

/// The whole table: the state after `event` in `state`; the same one when the event means nothing there.
ServoState stateAfter(ServoState state, ServoEvent event);

/// One change of state.
struct ServoTransition {
  ServoState from = ServoState::kIdle, to = ServoState::kIdle;
  ServoCause cause = ServoCause::kNone;
  std::int64_t time_us = 0;  ///< The loop's clock [us].
  std::string reason;        ///< The cause with its numbers, in words.
};

/// How many frames and how much time the states wait for.
struct ServoStateSettings {
  int frames_to_start = 3;
  int frames_to_resume = 2;  ///< Accepted in a row after a hold.
  double max_frame_gap_ms = 250;
  double frames_gone_ms = 2000;
  double max_contradiction_ms = 2000;
  double max_request_age_ms = 2000;

  void visit(SettingsVisitor& v) {
    v.integer("frames_to_start", frames_to_start, 1, 1000,
              "Frames accepted in a row, until the machine moves for the first time after START");
    v.number("max_frame_gap_ms", max_frame_gap_ms, 1, 60e3, "No frame for longer: hold");
    v.number("frames_gone_ms", frames_gone_ms, 1, 600e3, "No frame for longer: fault");
    v.number("max_contradiction_ms", max_contradiction_ms, 1, 600e3,
             "Frames that contradict joints and calibration, for longer: fault");
    v.number("max_request_age_ms", max_request_age_ms, 1, 600e3,
             "Largest time between the status that a request answers and the newest frame");
    v.fixed("frames_to_resume", frames_to_resume, 1, 1000);
  }
};

/// Whether the machine may move: IDLE, ARMED, HOLD, SERVO, FAULT, EMERGENCY_STOP. Begins in IDLE; only SERVO moves.
///
/// Knows no clock: each call says what time it is, by the loop's own clock [us]. A clock that runs backwards is a
/// fault.
class ServoStateMachine {
 public:
  /// Why a frame is rejected: it shows too little, or it contradicts joints and calibration.
  enum class RejectionKind { kUnseen, kContradiction };

  /// Throws InputError when a setting is out of its range.
  explicit ServoStateMachine(const ServoStateSettings& settings);

  /// The operator's request. Returns why it was refused; nothing when it was obeyed or had nothing to change.
  ///
  /// @param newest_frame_us  Time of the newest frame, its sender's clock; 0: none has come.
  std::optional<std::string> request(const ServoRequest& request, std::int64_t newest_frame_us, std::int64_t now_us);

  void accept(std::int64_t now_us);  ///< A frame that may move the machine.
  void reject(RejectionKind kind, const std::string& reason, std::int64_t now_us);  ///< One that may not.
  void fault(ServoCause cause, const std::string& reason, std::int64_t now_us);     ///< Latched, unless idle.

  /// Time passes; to be called at least as often as frames should come.
  /// @param silence  What was heard instead of a frame that can be used, in words; empty: unknown.
  void wait(std::int64_t now_us, const std::function<std::string()>& silence = {});

  ServoState state() const { return state_; }
  bool moves() const { return state_ == ServoState::kServo; }

  /// Why the machine stands still, in words; empty in SERVO.
  const std::string& reason() const { return reason_; }

  std::int64_t transitions() const { return transitions_; }

  /// Fills in state, its reason, and how and when it came about.
  void describe(ServoStatus& status) const;

  /// The last changes of state, oldest first: 256 at most.
  const std::deque<ServoTransition>& log() const { return log_; }

 private:
  bool active() const;
  bool clockRuns(std::int64_t now_us);
  void change(ServoEvent event, ServoCause cause, const std::string& reason, std::int64_t now_us);
  std::optional<std::string> refusal(const ServoRequest& request, std::int64_t newest_frame_us) const;

  ServoStateSettings settings_;
  ServoState state_ = ServoState::kIdle;
  std::string reason_ = "idle";
  std::int64_t transitions_ = 0;
  std::deque<ServoTransition> log_;
  int accepted_in_a_row_ = 0;
  bool has_moved_ = false;  // Since START: a hold resumes sooner than a start begins.
  std::optional<std::int64_t> now_us_, last_frame_us_, contradicted_since_us_;
  std::optional<ServoRequest> last_request_;
};

}  // namespace angio::servo
