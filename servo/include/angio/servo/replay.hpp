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

  /// Counts one command of both, and how they differ, if they do.
  void compare(const std::string& frame, const std::optional<std::string>& difference);

  /// Notes what went another way, if nothing did before.
  void differs(const std::string& how);

  /// After all frames: notes logged commands that were left over.
  void finish();
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

/// How a field differs, in words with both values; nothing when all bits are equal: -0 is another number than 0 here.
std::optional<std::string> difference(const std::string& field, std::int64_t replayed, std::int64_t logged);
std::optional<std::string> difference(const std::string& field, double replayed, double logged);

/// The first field in which two commands differ.
std::optional<std::string> difference(const CArmCommand& replayed, const CArmCommand& logged);

/// The same, of what every machine's command has.
template <typename Command>
std::optional<std::string> differenceInName(const Command& replayed, const Command& logged) {
  if (auto d = difference("utime", replayed.time_us, logged.time_us)) return d;
  if (auto d = difference("frame_sequence", replayed.frame_sequence, logged.frame_sequence)) return d;
  if (auto d = difference("sequence", replayed.sequence, logged.sequence)) return d;
  return difference("valid_for_us", replayed.valid_for_us, logged.valid_for_us);
}

}  // namespace angio
