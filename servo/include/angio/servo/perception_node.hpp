// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/messaging/mailbox.hpp"
#include "angio/registration/message_conversion.hpp"
#include "angio/servo/servo_loop.hpp"
#include "angio/servo/state_history.hpp"

namespace angio {

/// What became of one frame.
struct PerceptionReport {
  RegistrationMessage message;         ///< As it went on the bus.
  Sight sight;                         ///< Empty when the frame was not even looked at.
  std::optional<std::string> doubted;  ///< Why the next frames are not looked for by this one; nothing when they are.
};

/// Eyes without hands: hears XRAY_FRAME and CARM_STATE, says REGISTRATION. Several may look at one X-ray, each with its
/// own settings.
class PerceptionNode {
 public:
  /// Of `settings` geometry, T_dsa_cb, perception and the supervisor's gates count: the same frames are believed as by
  /// a loop. Borrows the bus, which must outlive it. Throws InputError when a setting is out of its range.
  PerceptionNode(Bus& bus, const ServoLoopSettings& settings, const VesselTree& tree);

  /// Looks at the newest frame that waits. Nothing comes back when none does, or when the joints are not known yet.
  std::optional<PerceptionReport> look();

  /// Frames and states that could not be decoded.
  std::int64_t refused() const { return frames_.refused() + joints_.refused(); }

 private:
  Bus& bus_;
  LatestValue<XrayFrame> frames_;
  JointHistory joints_;
  Perception perception_;
  Supervisor supervisor_;
};

}  // namespace angio
