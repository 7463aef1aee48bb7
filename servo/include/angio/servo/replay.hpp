// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "angio/servo/servo_loop.hpp"

namespace angio {

/// One frame of a log as it was answered again.
struct ReplayedFrame {
  const XrayFrame& frame;             ///< Borrowed for the call.
  const ServoReport& report;          ///< What the loop makes of it now.
  std::optional<CArmCommand> logged;  ///< What was commanded then, when the log holds it.
  double part = 0;                    ///< How much of the replay is done, 0 to 1.
};
using ReplayWatcher = std::function<void(const ReplayedFrame&)>;

/// What a replay found.
struct ReplaySummary {
  std::int64_t frames = 0;    ///< X-ray frames in the log that could be decoded, whether they were answered or not.
  std::int64_t answered = 0;  ///< Those that the loop answered again.
  std::int64_t held = 0;      ///< Among them.
  std::int64_t commands = 0;  ///< In the log.
  std::int64_t compared = 0;  ///< Commands that both have.
  std::int64_t equal = 0;     ///< Among them, bit for bit.
  bool knew_inputs = false;   ///< Whether the log says which joints went with which frame.
  std::int64_t skipped_bytes = 0;  ///< Of the file, that were no messages.
  /// What first went another way than in the log: frame, field and both values, or what the log lacks.
  std::optional<std::string> first_difference;
};

/// Sends a log (of lcm-logger, or of a RecordingBus) through the loop again.
///
/// Frames and joints are those that SERVO_INPUT names, in its order, whatever else was on the bus: the commands are
/// those of the live loop, bit for bit, when its settings, tree and calibration are given. A command's sequence that
/// begins again is a loop that was started again. A log without SERVO_INPUT gives the frames that its commands name, or
/// all frames when it has no commands, with the joints that had been heard before each frame.
///
/// Throws InputError when the log cannot be read or holds no frame that can be answered, and as ServoLoop does.
ReplaySummary replay(const std::string& log_path, const ServoLoopSettings& settings, const VesselTree& tree,
                     const ReplayWatcher& watcher = {});

/// The first field in which two commands differ, in words with both values; nothing when all bits are equal.
std::optional<std::string> difference(const CArmCommand& replayed, const CArmCommand& logged);

}  // namespace angio
