// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/disturbed_bus.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "angio/base/fnv1a.hpp"

namespace angio::messaging {
namespace {

std::uint64_t hashOf(const void* data, std::size_t size) {
  Fnv1a hash;
  hash.add(data, size);
  return hash.value();
}

std::int64_t after_us(std::int64_t time_us, double delay_ms) {
  const std::int64_t delay_us = std::llround(delay_ms * 1e3), last_us = std::numeric_limits<std::int64_t>::max();
  return time_us > last_us - delay_us ? last_us : time_us + delay_us;
}

}  // namespace

bool DisturbedBus::Link::loses() {
  const bool burst = in_burst || happens(settings.burst_probability);
  in_burst = burst && !happens(1 / settings.burst_messages);
  return burst || happens(settings.loss_probability);
}

DisturbedBus::DisturbedBus(Bus& bus, const DisturbanceSettings& everywhere, std::uint64_t seed)
    : bus_(bus), everywhere_(everywhere), seed_(seed) {
  checkSettings("disturbance", everywhere);
}

DisturbedBus::Link& DisturbedBus::link(const std::string& channel) {
  const auto found = links_.find(channel);
  if (found != links_.end()) return found->second;
  Link made;
  made.settings = everywhere_;
  made.engine.seed(seed_ ^ hashOf(channel.data(), channel.size()));
  return links_.emplace(channel, std::move(made)).first->second;
}

void DisturbedBus::disturb(const std::string& channel, const DisturbanceSettings& settings) {
  checkSettings("disturbance of " + channel, settings);
  Link& disturbed = link(channel);
  disturbed.settings = settings;
  if (settings.burst_probability == 0) disturbed.in_burst = false;
  if (settings.stalled) return;
  for (auto& bytes : std::exchange(disturbed.stalled, {})) transmit(disturbed, {channel, std::move(bytes)});
}

void DisturbedBus::publish(const std::string& channel, const std::vector<std::uint8_t>& bytes) {
  ++counts_.published;
  Link& link = this->link(channel);
  if (link.loses()) {
    ++counts_.lost;
    return;
  }
  Message message{channel, bytes};
  if (link.change) link.change(message.bytes);
  if (!message.bytes.empty() && link.happens(link.settings.corruption_probability)) {
    ++counts_.corrupted;
    for (std::uint64_t left = 1 + link.engine() % 4; left > 0; --left) {
      const auto change = static_cast<std::uint8_t>(1 + link.engine() % 255);
      message.bytes[link.engine() % message.bytes.size()] ^= change;
    }
  }
  if (link.settings.stalled) {
    link.stalled.push_back(std::move(message.bytes));
    return;
  }
  if (link.happens(link.settings.duplicate_probability)) {
    ++counts_.duplicated;
    transmit(link, message);
    const double after_ms = link.uniform() * link.settings.reorder_delay_ms;
    in_transit_.emplace(after_us(std::max(link.last_due_us, now_us_), after_ms), std::move(message));
  } else {
    transmit(link, std::move(message));
  }
}

void DisturbedBus::transmit(Link& link, Message message) {
  std::int64_t due_us = after_us(now_us_, link.settings.delay_ms + link.uniform() * link.settings.jitter_ms);
  if (link.happens(link.settings.reorder_probability)) {
    ++counts_.overtaken;
    due_us = after_us(due_us, link.uniform() * link.settings.reorder_delay_ms);
  } else {
    due_us = link.last_due_us = std::max(link.last_due_us, due_us);
  }
  send(std::move(message), due_us);
}

void DisturbedBus::send(Message message, std::int64_t due_us) {
  if (due_us <= now_us_) {
    hand(message);
  } else {
    in_transit_.emplace(due_us, std::move(message));
  }
}

void DisturbedBus::hand(const Message& message) {
  constexpr std::size_t kMaxHanded = 1000;
  const auto overheard = handed_.find(message.channel);
  if (overheard != handed_.end()) {
    for (const auto& hashes : overheard->second) {
      hashes->push_back(hashOf(message.bytes.data(), message.bytes.size()));
      if (hashes->size() > kMaxHanded) hashes->pop_front();
    }
  }
  bus_.publish(message.channel, message.bytes);
}

void DisturbedBus::overhear(const std::string& channel, Handler handler) {
  auto hashes = std::make_shared<std::deque<std::uint64_t>>();
  handed_[channel].push_back(hashes);
  bus_.subscribe(channel, [hashes, handler = std::move(handler)](const std::uint8_t* data, std::size_t size) {
    const auto own = std::find(hashes->begin(), hashes->end(), hashOf(data, size));
    if (own != hashes->end()) {
      hashes->erase(own);
    } else {
      handler(data, size);
    }
  });
}

void DisturbedBus::advance(std::int64_t now_us) {
  now_us_ = std::max(now_us_, now_us);
  while (!in_transit_.empty() && in_transit_.begin()->first <= now_us_) {
    const Message message = std::move(in_transit_.begin()->second);
    in_transit_.erase(in_transit_.begin());  // First: one that cannot be sent must not come again.
    hand(message);
  }
}

std::optional<std::int64_t> DisturbedBus::nextDue_us() const {
  return in_transit_.empty() ? std::nullopt : std::optional(in_transit_.begin()->first);
}

}  // namespace angio::messaging
