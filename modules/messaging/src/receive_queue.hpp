// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <deque>
#include <map>
#include <optional>
#include <string>

#include "angio/messaging/lcm_datagrams.hpp"

namespace angio::messaging {

/// Messages that wait for their reader, in the order in which they came. When there are too many, the oldest go: what a
/// slow reader gets is what is nearest to the present.
class ReceiveQueue {
 public:
  /// Bounds for one channel, for all channels together that nobody named, and for all bytes. kMaxWaiting is LCM's.
  static constexpr int kMaxWaiting = 30, kMaxWaitingUnnamed = 100;
  static constexpr std::size_t kMaxWaiting_bytes = std::size_t{64} << 20;

  /// `named`: somebody subscribed to the message's channel by its name.
  void push(LcmMessage message, bool named);

  /// The oldest message, or nothing.
  std::optional<LcmMessage> pop();

  bool empty() const { return waiting_.empty(); }

 private:
  struct Waiting {
    std::string group;  // Channel, or empty for one that nobody named.
    LcmMessage message;
  };

  void erase(std::deque<Waiting>::iterator oldest);

  std::deque<Waiting> waiting_;
  std::map<std::string, int> counts_;  // By group.
  std::size_t bytes_ = 0;
};

}  // namespace angio::messaging
