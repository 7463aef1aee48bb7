// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/heard_channels.hpp"

#include <algorithm>

namespace angio::servo {
namespace {

std::string from(const std::string& sender) { return sender.empty() ? "" : " from " + sender; }

std::string messages(std::int64_t count, const std::string& channel, const std::string& sender) {
  return std::to_string(count) + (count == 1 ? " message on " : " messages on ") + channel + from(sender);
}

// A reason goes on the bus and to a terminal.
std::string printable(const std::string& text) {
  constexpr std::size_t kMaxShown = 160;
  std::string shown = text.substr(0, kMaxShown);
  std::replace_if(
      shown.begin(), shown.end(), [](unsigned char c) { return c < 0x20 || c >= 0x7f; }, '?');
  return shown;
}

}  // namespace

std::optional<std::string> undecodable(const ChannelRecord& record) {
  if (record.refused_in_a_row == 0) return std::nullopt;
  return messages(record.refused_in_a_row, record.channel, record.refused_sender) +
         " cannot be decoded: " + printable(record.refused);
}

std::string silenceOf(const ChannelRecord& frames, const std::vector<ChannelRecord>& states, bool states_heard,
                      const std::vector<std::string>& awaited) {
  if (auto broken = undecodable(frames)) return *broken;
  if (frames.received == 0) return "nothing has come on " + frames.channel;
  const std::string come = "frames come" + from(frames.sender);
  if (!states_heard) {
    const ChannelRecord& arm = states.front();
    return come + ", but " + undecodable(arm).value_or("nothing has come on " + arm.channel);
  }
  if (frames.dropped_in_a_row > 0) {
    return messages(frames.dropped_in_a_row, frames.channel, frames.sender) +
           " came twice or late: their sequence must rise by one per frame";
  }
  if (!awaited.empty()) return come + ", but nothing has come on " + awaited.front() + " of them";
  return "nothing more has come on " + frames.channel +
         (frames.sender.empty() ? "" : ", the last from " + frames.sender);
}

}  // namespace angio::servo
