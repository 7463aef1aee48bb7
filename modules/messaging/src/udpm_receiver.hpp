// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "angio/messaging/lcm_datagrams.hpp"
#include "udpm_address.hpp"

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

/// Receives LCM's messages of a multicast group. A thread of its own drains the socket while the reader is busy,
/// because the system's buffer may be smaller than one frame. Its memory is bounded by LcmDatagrams and ReceiveQueue.
class UdpmReceiver {
 public:
  /// Sends a text on the channel kLcmSelfTestChannel, as all messages of this program are sent.
  using Say = std::function<void(const std::string& text)>;

  /// Joins the group and hears one message of its own, by `say`. Throws std::runtime_error that says why this machine
  /// cannot.
  UdpmReceiver(const UdpmAddress& address, const Say& say);
  UdpmReceiver(const UdpmReceiver&) = delete;
  UdpmReceiver& operator=(const UdpmReceiver&) = delete;
  ~UdpmReceiver();

  /// Receives messages of this channel, or of every channel, from now on.
  void want(const std::string& channel);
  void wantAll();

  /// The oldest message that waits. Waits up to `wait_ms` for one; returns nothing after that time or after a signal.
  /// Throws std::runtime_error when receiving has failed.
  std::optional<LcmMessage> next(int wait_ms);

  /// The address that this program's own messages come from.
  const UdpSender& self() const { return self_; }

  /// How many malformed datagrams came so far.
  std::int64_t refused() const { return refused_; }

 private:
  void join(const UdpmAddress& address);
  bool hearsItself(const Say& say);
  void run();
  bool drain(std::vector<std::uint8_t>& datagram);
  void deliver(LcmMessage message);
  void fail(int error);
  bool wants(const std::string& channel) const;
  std::optional<LcmMessage> pop();

  const OpenDescriptor socket_, ready_, stop_;  // ready_ is readable while a message waits or receiving has failed.
  UdpSender self_;
  LcmDatagrams datagrams_;  // The thread's.
  std::atomic<std::int64_t> refused_{0};

  mutable std::mutex mutex_;  // Of all below.
  std::set<std::string> channels_;
  bool all_ = false;
  ReceiveQueue queue_;
  std::optional<int> failure_;  // As in errno.

  std::thread thread_;
};

}  // namespace angio::messaging
