// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/messaging/mailbox.hpp"
#include "angio/perception/gated_perception.hpp"
#include "angio/perception/state_history.hpp"
#include "angio/registration/message_conversion.hpp"

namespace angio::perception {

/// What became of one frame.
struct PerceptionReport {
  std::int64_t frame_sequence = 0;
  /// As it was published; nothing of a frame that was rejected unseen.
  std::optional<RegistrationMessage> message;
  Observation observation;               ///< Empty when the frame was not looked at.
  std::optional<std::string> rejection;  ///< Why the observation is not tracked; nothing when it is.
};

/// Perception without motion: hears XRAY_FRAME and CARM_STATE, publishes REGISTRATION. Several may observe one X-ray,
/// each with its own settings.
class PerceptionNode {
 public:
  /// Borrows the bus, which must outlive it. Throws InputError when a setting is out of its range.
  PerceptionNode(Bus& bus, const GatedPerceptionSettings& settings, const VesselTree& tree);

  /// Observes the newest frame that waits. Nothing comes back when none does, or when the joints are not known yet.
  std::optional<PerceptionReport> observe();

  /// Frames and states that could not be decoded.
  std::int64_t refused() const { return frames_.refused() + joints_.refused(); }

 private:
  Bus& bus_;
  LatestMessage<XrayFrame> frames_;
  JointHistory joints_;
  GatedPerception perception_;
};

}  // namespace angio::perception
