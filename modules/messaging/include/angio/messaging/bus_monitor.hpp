// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "angio/messaging/namespace.hpp"
#include "angio/types/any_message.hpp"

namespace angio::messaging {

/// What one channel of a bus has carried so far.
struct ChannelReport {
  std::string channel;  ///< Without control characters.
  std::string type;     ///< Name of the .lcm type, or its fingerprint in hexadecimal when we do not know it.
  std::int64_t messages = 0;
  std::int64_t bytes = 0;
  std::int64_t undecodable = 0;  ///< Among the messages of types we know, and those too short for a fingerprint.
  std::int64_t missing = 0;      ///< Sequence numbers that were jumped over and have not come late since; 0 of types
                                 ///< whose numbers may have gaps (numberingOf()).
  std::int64_t duplicates = 0;   ///< The newest number again, or one that had not been missing.
  std::int64_t late = 0;         ///< Came after a higher number.
  std::int64_t restarts = 0;     ///< A lower number with a later time: its sender began again.
  double rate_hz = 0;            ///< Over the last seconds.
  double bytes_per_s = 0;        ///< The same.
  double age_s = 0;              ///< Since the last message.
  /// From the message's own time to its arrival [s], median of the last seconds. Only where both are of one clock, the
  /// monotonic one of this machine; nothing where they cannot be.
  std::optional<double> latency_s;
  double delay_spread_s = 0;  ///< Between the slowest and the fastest message of the last seconds, whatever the clocks.
  std::string last_value;     ///< For people; empty when the last message could not be decoded.
  std::string last_error;     ///< Why the last undecodable one could not be.
};

/// Keeps account of what is on a bus. Knows no clock: arrivals are told by the caller, in one order of time.
class BusMonitor {
 public:
  /// @param window_s  How long the last seconds are, > 0.
  explicit BusMonitor(double window_s = 3) : window_us_(static_cast<std::int64_t>(window_s * 1e6)) {}

  /// A message has arrived; its bytes may be anything. Channels are listed up to 1,000, and among them up to 200 whose
  /// first message is of no type we know. A message on a further channel counts in unlisted() only.
  void hear(const std::string& channel, const std::uint8_t* data, std::size_t size, std::int64_t arrival_us);

  /// All channels by name, as they stand at `now_us`.
  std::vector<ChannelReport> report(std::int64_t now_us) const;

  /// Messages on channels that are not listed, because too many are.
  std::int64_t unlisted() const { return unlisted_; }

 private:
  struct Arrival {
    std::int64_t time_us;
    std::int64_t bytes;
    std::optional<double> delay_us;  // By the message's own time.
  };
  struct Channel {
    ChannelReport sums;
    std::deque<Arrival> recent;
    std::optional<std::int64_t> newest_sequence;
    std::int64_t newest_time_us = 0;
    std::deque<std::int64_t> missing;  // The last of them, to know a late one from a duplicate.
    void count(const AnyMessage& message);
  };

  Channel* channelOf(const std::string& name, bool known_type);

  std::int64_t window_us_;
  std::map<std::string, Channel> channels_;
  std::size_t unknown_channels_ = 0;  // Listed ones whose first message was of no type we know.
  std::int64_t unlisted_ = 0;
};

}  // namespace angio::messaging
