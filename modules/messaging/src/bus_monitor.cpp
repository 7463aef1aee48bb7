// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/bus_monitor.hpp"

#include <algorithm>

#include "angio/base/formatted.hpp"
#include "angio/messaging/any_message.hpp"
#include "angio/messaging/authenticated_bus.hpp"
#include "angio/messaging/lcm_datagrams.hpp"
#include "description.hpp"

namespace angio::messaging {
namespace {

constexpr std::size_t kMaxChannels = 1000;
// Fewer of them: a broken sender's invented channels must not take the places of those that matter.
constexpr std::size_t kMaxUnknownChannels = 200;
constexpr std::size_t kMaxRecent = 10000;
constexpr std::size_t kMaxRemembered = 1000;
// Two clocks that differ by less are taken for one: messages do not travel longer, and machines are not started
// together.
constexpr double kMaxLatency_us = 10e6;

std::string typeOf(const std::uint8_t* data, std::size_t size) {
  if (const auto known = messageType(data, size)) return *known;
  if (size < 8) return "too short";
  if (isEnvelope(data, size)) return "envelope";
  std::string hex = "unknown ";
  for (int i = 0; i < 8; ++i) hex += formatted("%02x", data[i]);
  return hex;
}

double difference(std::int64_t a, std::int64_t b) { return static_cast<double>(a) - static_cast<double>(b); }

}  // namespace

void BusMonitor::Channel::count(const AnyMessage& message) {
  const std::int64_t sequence = sequenceOf(message), time_us = timeOf(message);
  const Numbering numbering = numberingOf(message);
  if (!newest_sequence || sequence > *newest_sequence) {
    if (newest_sequence && numbering.gaps_are_losses) {
      // In doubles: numbers from the wire may lie further apart than an int64 holds.
      const double jumped = difference(sequence, *newest_sequence) - 1;
      sums.missing += static_cast<std::int64_t>(std::min(jumped, 1e15));
      const auto remembered = static_cast<std::int64_t>(std::min(jumped, double{kMaxRemembered}));
      for (std::int64_t back = remembered; back > 0; --back) missing.push_back(sequence - back);
      while (missing.size() > kMaxRemembered) missing.pop_front();
    }
  } else if (sequence < *newest_sequence && time_us > newest_time_us) {
    ++sums.restarts;
    missing.clear();
  } else if (sequence == *newest_sequence && !numbering.repeats_are_copies) {
    newest_time_us = std::max(newest_time_us, time_us);
    return;
  } else {
    const auto awaited = std::find(missing.begin(), missing.end(), sequence);
    if (awaited == missing.end()) {
      ++sums.duplicates;
    } else {
      missing.erase(awaited);
      --sums.missing;
      ++sums.late;
    }
    return;
  }
  newest_sequence = sequence;
  newest_time_us = time_us;
}

// Null where it is new and there is no place left.
BusMonitor::Channel* BusMonitor::channelOf(const std::string& name, bool known_type) {
  const auto found = channels_.find(name);
  if (found != channels_.end()) return &found->second;
  if (channels_.size() >= kMaxChannels || (!known_type && unknown_channels_ >= kMaxUnknownChannels)) return nullptr;
  if (!known_type) ++unknown_channels_;
  return &channels_[name];
}

void BusMonitor::hear(const std::string& channel, const std::uint8_t* data, std::size_t size, std::int64_t arrival_us) {
  if (channel == kLcmSelfTestChannel) return;  // lcm-logger writes it down.
  Channel* listed = channelOf(channel, messageType(data, size).has_value());
  if (listed == nullptr) {
    ++unlisted_;
    return;
  }
  Channel& c = *listed;
  ++c.sums.messages;
  c.sums.bytes += static_cast<std::int64_t>(size);
  c.sums.type = typeOf(data, size);
  c.sums.last_value.clear();
  Arrival arrival{arrival_us, static_cast<std::int64_t>(size), std::nullopt};
  if (size < 8 || messageType(data, size)) {
    const auto decoded = decodeAny(data, size);
    if (decoded.value) {
      c.sums.last_value = describe(*decoded.value);
      arrival.delay_us = difference(arrival_us, timeOf(*decoded.value));
      c.count(*decoded.value);
    } else {
      ++c.sums.undecodable;
      c.sums.last_error = decoded.error;
    }
  }
  c.recent.push_back(arrival);
  while (c.recent.size() > kMaxRecent || c.recent.front().time_us < arrival_us - window_us_) c.recent.pop_front();
}

std::vector<ChannelReport> BusMonitor::report(std::int64_t now_us) const {
  std::vector<ChannelReport> reports;
  for (const auto& [name, channel] : channels_) {
    ChannelReport r = channel.sums;
    r.channel = wire::harmless(name, name.size());
    r.age_s = 1e-6 * difference(now_us, channel.recent.back().time_us);
    const auto first = std::find_if(channel.recent.begin(), channel.recent.end(),
                                    [&](const Arrival& a) { return a.time_us >= now_us - window_us_; });
    std::vector<double> delays_us;
    double bytes = 0;
    for (auto a = first; a != channel.recent.end(); ++a) {
      if (a != first) bytes += static_cast<double>(a->bytes);
      if (a->delay_us) delays_us.push_back(*a->delay_us);
    }
    const auto heard = channel.recent.end() - first;
    // n messages have n - 1 intervals; when they have stopped, the silence behind them counts as well.
    if (heard > 1) {
      const double between_s = 1e-6 * difference(channel.recent.back().time_us, first->time_us);
      const double mean_s = between_s / static_cast<double>(heard - 1);
      const double span_s = r.age_s > 2 * mean_s ? between_s + r.age_s : between_s;
      if (span_s > 0) {
        r.rate_hz = static_cast<double>(heard - 1) / span_s;
        r.bytes_per_s = bytes / span_s;
      }
    }
    if (!delays_us.empty()) {
      std::sort(delays_us.begin(), delays_us.end());
      r.delay_spread_s = 1e-6 * (delays_us.back() - delays_us.front());
      const double median_us = delays_us[delays_us.size() / 2];
      if (median_us >= 0 && median_us < kMaxLatency_us) r.latency_s = 1e-6 * median_us;
    }
    reports.push_back(std::move(r));
  }
  return reports;
}

}  // namespace angio::messaging
