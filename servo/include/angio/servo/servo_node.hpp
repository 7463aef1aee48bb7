// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/messaging/mailbox.hpp"
#include "angio/servo/joint_history.hpp"
#include "angio/servo/servo_loop.hpp"

namespace angio {

/// The loop's side of a bus: hears XRAY_FRAME and CARM_STATE, says CARM_COMMAND, REGISTRATION and SERVO_STATUS.
class ServoNode {
 public:
  /// Borrows the bus, which must outlive it.
  ServoNode(Bus& bus, const ServoLoopSettings& settings, const VesselTree& tree);

  /// Answers the newest frame that waits. Nothing comes back when none does, or when the joints are not known yet.
  std::optional<ServoReport> answer();

  /// Frames and states that could not be decoded or came twice or late.
  std::int64_t refused() const { return frames_.refused() + joints_.refused(); }

  const ServoLoop& loop() const { return loop_; }

 private:
  Bus& bus_;
  LatestValue<XrayFrame> frames_;
  JointHistory joints_;
  ServoLoop loop_;
};

/// The messages that say what the loop did. A pose, covariance or residual that is not finite is left at identity and
/// zero; its status is then not "converged".
RegistrationMessage registrationMessage(const ServoReport& report);
ServoStatus servoStatus(const ServoReport& report);

}  // namespace angio
