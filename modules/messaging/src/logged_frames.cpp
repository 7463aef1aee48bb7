// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/logged_frames.hpp"

#include <stdexcept>

#include "angio/types/channels.hpp"

namespace angio::messaging {

void LoggedFrames::enter(const LogEvent& event) {
  if (event.channel != kXrayFrameChannel) return;
  const auto frame = decode<XrayFrame>(event.bytes.data(), event.bytes.size());
  if (!frame.value) return;
  const FrameName name(frame.value->sequence, frame.value->time_us);
  if (place_.emplace(name, event.position_bytes).second) frames_.push_back({name, event.position_bytes});
}

XrayFrame LoggedFrames::readAt(LogReader& log, std::int64_t position_bytes) {
  log.seek(position_bytes);
  const auto event = log.next();
  auto frame = event ? decode<XrayFrame>(event->bytes.data(), event->bytes.size()) : Decoded<XrayFrame>();
  if (!frame.value) throw std::runtime_error("the log has changed while it was read");
  return std::move(*frame.value);
}

}  // namespace angio::messaging
