// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>
#include <string>

#include "angio/evaluation/live_overlay.hpp"
#include "angio/types/any_message.hpp"

namespace angio::evaluation {

/// Puts together what belongs to one frame from what comes on a bus. Knows no clock: arrivals are told by the caller.
class LiveFeed {
 public:
  /// Takes a message that came on a channel. When a frame is complete, its scene comes back: with the loop's status,
  /// while a loop reports, the C-arm's before the catheter's; else with its registration, while somebody registers;
  /// else as it is. Frames that nobody answered in time are left out while others are answered.
  std::optional<LiveScene> hear(const std::string& channel, AnyMessage message, std::int64_t arrival_us);

 private:
  LiveScene* sceneOf(std::int64_t frame_sequence, std::int64_t time_us);
  std::optional<LiveScene> take(LiveScene* scene);

  std::deque<LiveScene> waiting_;  // The newest frames, oldest first.
  std::optional<CArmState> state_;
  std::optional<std::int64_t> last_carm_status_us_, last_status_us_, last_registration_us_;
};

}  // namespace angio::evaluation
