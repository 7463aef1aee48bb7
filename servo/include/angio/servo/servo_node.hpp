// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/messaging/mailbox.hpp"
#include "angio/servo/operator.hpp"
#include "angio/servo/servo_loop.hpp"
#include "angio/servo/state_history.hpp"

namespace angio {

/// The loop's side of a bus under a safety supervisor: hears XRAY_FRAME, CARM_STATE and SERVO_REQUEST, says
/// CARM_COMMAND, SERVO_INPUT, REGISTRATION and SERVO_STATUS. Stands still until an operator has armed and started it.
/// As its settings say, it hears REGISTRATION, and does not say it then, and CATHETER_TIP.
class ServoNode {
 public:
  /// Borrows the bus, which must outlive it. Throws InputError when a setting is out of its range.
  ServoNode(Bus& bus, const ServoLoopSettings& settings, const VesselTree& tree);

  /// Hears what has come, and answers the newest frame that waits; nothing comes back when none does. To be called
  /// whenever the bus was handled, and at least as often as frames should come.
  ///
  /// @param now_us  The caller's own clock [us].
  std::optional<ServoReport> answer(std::int64_t now_us);

  /// Frames and states that could not be decoded.
  std::int64_t refused() const { return frames_.refused() + joints_.refused(); }

  const SafetySupervisor& safety() const { return safety_; }
  const ServoLoop& loop() const { return loop_; }

 private:
  void hear(std::int64_t now_us);
  void judge(const ServoReport& report, const CArmState& state, std::int64_t now_us);
  ServoReport answerOf(const ToldFrame& told, const CArmState& state, std::int64_t now_us);
  void say(ServoStatus status);

  Bus& bus_;
  CArmGeometry carm_;
  FrameMailbox frames_;
  LatestValue<CArmState> newest_joints_;
  HeardRequests requests_;
  JointHistory joints_;
  ServoLoop loop_;
  SafetySupervisor safety_;
  std::int64_t said_transitions_ = 0;
  ServoStatus last_status_;
};

/// The messages that say what the loop did. A pose, covariance or residual that is not finite is left at identity and
/// zero; its status is then not "converged".
RegistrationMessage registrationMessage(const ServoReport& report);
ServoStatus servoStatus(const ServoReport& report);

}  // namespace angio
