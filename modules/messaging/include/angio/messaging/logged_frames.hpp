// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "angio/messaging/codec.hpp"
#include "angio/messaging/log_reader.hpp"

namespace angio::messaging {

/// Sequence and time [us]. A frame's number alone does not name it: a sender that starts again counts from one.
using FrameName = std::pair<std::int64_t, std::int64_t>;

template <typename Message>
FrameName frameOf(const Message& message) {
  return {message.frame_sequence, message.time_us};
}

/// What a log says of its frames, by their names.
template <typename T>
using ByFrame = std::map<FrameName, T>;

template <typename T>
std::optional<T> of(const FrameName& frame, const ByFrame<T>& said) {
  const auto found = said.find(frame);
  return found == said.end() ? std::nullopt : std::optional(found->second);
}

/// The X-ray frames of a log, their images left in the file until they are asked for.
class LoggedFrames {
 public:
  /// A frame, and where its event stands in the log file.
  struct Entry {
    FrameName name;
    std::int64_t position_bytes;
  };

  /// Enters the event if it is a frame that can be decoded and was not entered before.
  void enter(const LogEvent& event);

  /// In the log's order.
  const std::vector<Entry>& all() const { return frames_; }

  /// Where a frame stands in the file; nothing when it was not in the log.
  std::optional<std::int64_t> position_bytes(const FrameName& frame) const { return of(frame, place_); }

  /// Throws std::runtime_error when there is no frame any more.
  static XrayFrame readAt(LogReader& log, std::int64_t position_bytes);

 private:
  std::vector<Entry> frames_;
  ByFrame<std::int64_t> place_;
};

}  // namespace angio::messaging
