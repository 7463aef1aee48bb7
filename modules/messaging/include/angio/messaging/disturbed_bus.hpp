// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/messaging/bus.hpp"

namespace angio::messaging {

/// What a network does to the messages of one channel. The default does nothing.
struct DisturbanceSettings {
  double loss_probability = 0;
  double burst_probability = 0;
  double burst_messages = 10;
  double delay_ms = 0;
  double jitter_ms = 0;
  double duplicate_probability = 0;
  double reorder_probability = 0;
  double reorder_delay_ms = 100;
  double corruption_probability = 0;
  bool stalled = false;

  void visit(SettingsVisitor& v) {
    v.number("loss_probability", loss_probability, 0, 1, "Probability that a message is lost, each by itself");
    v.number("burst_probability", burst_probability, 0, 1, "Probability that losses in a row begin with a message");
    v.number("burst_messages", burst_messages, 1, 1e6, "Losses in a row, on average (geometric, Gilbert's model)");
    v.number("delay_ms", delay_ms, 0, 60e3, "Delay of each message");
    v.number("jitter_ms", jitter_ms, 0, 60e3,
             "Further delay of each message, uniform up to this; messages keep their order");
    v.number("duplicate_probability", duplicate_probability, 0, 1,
             "Probability that a message comes twice, the second time up to reorder_delay_ms later");
    v.number("reorder_probability", reorder_probability, 0, 1,
             "Probability that a message is overtaken by those behind it");
    v.number("reorder_delay_ms", reorder_delay_ms, 0, 60e3,
             "Messages that come in up to this time later overtake one that is reordered");
    v.number("corruption_probability", corruption_probability, 0, 1,
             "Probability that one to four bytes of a message are others");
    v.flag("stalled", stalled, "Nothing comes through; all of it at once when this ends");
  }
};

/// What became of the messages that were published through a DisturbedBus.
struct DisturbanceCounts {
  std::int64_t published = 0, lost = 0, duplicated = 0, overtaken = 0, corrupted = 0;
};

/// One party's bad connection to a bus, in simulated time: what it publishes is lost, late, doubled, overtaken or
/// garbled on its way; what it receives is what came to the bus. With default settings it is the bus itself.
///
/// Knows no clock: the time is what advance() was last told. The same calls and seed give the same messages; each
/// channel has its own random numbers, so traffic on one does not change another's fate.
class DisturbedBus : public Bus {
 public:
  /// Borrows the bus, which must outlive it. `everywhere` is for channels that disturb() does not name. Throws
  /// InputError when a setting is out of its range.
  DisturbedBus(Bus& bus, const DisturbanceSettings& everywhere, std::uint64_t seed);

  /// From now on, messages that are published on this channel go through `settings`; those in transit are not changed.
  /// Throws InputError when a setting is out of its range.
  void disturb(const std::string& channel, const DisturbanceSettings& settings);

  /// From now on, changes each message that is published on this channel, before all else; an empty function ends it.
  void tamper(const std::string& channel, std::function<void(std::vector<std::uint8_t>&)> change) {
    link(channel).change = std::move(change);
  }

  /// It is `now_us` [us]: hands to the bus all that is due by then, the earliest first. A time before the present,
  /// which is 0 at first, counts as the present.
  void advance(std::int64_t now_us);

  /// When the next message is due [us]; nothing when none is in transit.
  std::optional<std::int64_t> nextDue_us() const;

  const DisturbanceCounts& counts() const { return counts_; }

  /// What has no delay goes straight to the bus; throws as it does, here or in advance().
  void publish(const std::string& channel, const std::vector<std::uint8_t>& bytes) override;
  void subscribe(const std::string& channel, Handler handler) override { bus_.subscribe(channel, std::move(handler)); }
  void subscribeAll(Listener listener) override { bus_.subscribeAll(std::move(listener)); }
  /// A message is this party's own when it is, byte for byte and as often, what was handed to the bus.
  void overhear(const std::string& channel, Handler handler) override;
  std::string sender() const override { return bus_.sender(); }
  int handle(std::chrono::milliseconds timeout) override { return bus_.handle(timeout); }
  bool ended() const override { return bus_.ended(); }
  std::int64_t refused() const override { return bus_.refused(); }

 private:
  struct Link {
    DisturbanceSettings settings;
    std::mt19937_64 engine;
    std::int64_t last_due_us = std::numeric_limits<std::int64_t>::min();  // Of messages that keep their order.
    bool in_burst = false;
    std::vector<std::vector<std::uint8_t>> stalled;
    std::function<void(std::vector<std::uint8_t>&)> change;

    double uniform() { return static_cast<double>(engine() >> 11) * 0x1p-53; }
    bool happens(double probability) { return probability > 0 && uniform() < probability; }
    bool loses();
  };
  struct Message {
    std::string channel;
    std::vector<std::uint8_t> bytes;
  };

  Link& link(const std::string& channel);
  void transmit(Link& link, Message message);
  void send(Message message, std::int64_t due_us);
  void hand(const Message& message);

  Bus& bus_;
  DisturbanceSettings everywhere_;
  std::uint64_t seed_;
  std::int64_t now_us_ = 0;
  std::map<std::string, Link> links_;
  std::multimap<std::int64_t, Message> in_transit_;  // By when they are due; equal times in the order of publishing.
  DisturbanceCounts counts_;
  // Of each overheard channel, hashes of what was handed to the bus and has not come round yet; shared with the
  // handlers.
  std::map<std::string, std::vector<std::shared_ptr<std::deque<std::uint64_t>>>> handed_;
};

}  // namespace angio::messaging
