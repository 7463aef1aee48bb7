// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/second_senders.hpp"

#include <algorithm>
#include <utility>

#include "angio/messaging/any_message.hpp"

namespace angio::servo {
namespace {

// No program is ended and started again in so short a time.
constexpr double kInTurns_us = 150e3;
// A sender that comes again after another one within this time has not ended.
constexpr double kComesAgain_us = 2e6;
constexpr double kContradictions_us = 1e6;
constexpr std::size_t kContradictions = 3;
// What is late is late by less than this, and by fewer numbers.
constexpr double kLate_us = 2e6, kLateNumbers = 1000;

constexpr std::size_t kMaxEvents = 4000;

// What is smaller is decoded as a whole, and counts only if it is sound; an image takes too long for that.
constexpr std::size_t kSmall_bytes = 10'000;

double between(std::int64_t from, std::int64_t to) { return static_cast<double>(to) - static_cast<double>(from); }

// Every state and frame begins with its fingerprint, its time and its number: an image need not be decoded for them.
std::int64_t numberAt(const std::uint8_t* data) {
  std::uint64_t bits = 0;
  for (int i = 0; i < 8; ++i) bits = bits << 8 | data[i];
  return static_cast<std::int64_t>(bits);
}

std::string inWords(const SecondSenders::Watched& watched, const std::string& senders) {
  const std::string other = senders.empty() ? "another program" : senders;
  switch (watched.kind) {
    case SecondSenders::Kind::kCommands:
      return other + " sends " + watched.what + " on " + watched.channel + ", beside this program: stop one";
    case SecondSenders::Kind::kStatuses:
      return "two " + watched.what + " on " + watched.channel + ": this program and " + other + ": stop one";
    case SecondSenders::Kind::kMachine:
      break;
  }
  return "two " + watched.what + " on " + watched.channel + ": " + senders + ": stop one";
}

}  // namespace

bool SenderWatch::contradicts(std::int64_t sequence, std::int64_t time_us) const {
  const double numbers = between(last_sequence_, sequence), ticked_us = between(last_time_us_, time_us);
  if (numbers == 0) return ticked_us != 0;
  const bool late = numbers < 0 && ticked_us < 0 && numbers > -kLateNumbers && ticked_us > -kLate_us;
  return !late && !(numbers > 0 && ticked_us > 0);
}

std::optional<std::string> SenderWatch::hear(const std::string& sender, std::int64_t sequence, std::int64_t time_us,
                                             std::int64_t now_us) {
  if (sender.empty()) return std::nullopt;
  std::optional<std::string> found;
  const auto within = [&](const std::string& who, double max_us) {
    const auto heard = heard_us_.find(who);
    return heard != heard_us_.end() && between(heard->second, now_us) <= max_us;
  };
  const bool same = sender == last_sender_, against = same && contradicts(sequence, time_us);
  // Two that count alike say each number twice; one that does not count says it again and again.
  repeats_ = same && sequence == last_sequence_ ? repeats_ + (time_us != last_time_us_ ? 1 : 0) : 0;
  const bool stuck = repeats_ > 1;
  if (!same) {
    if (!last_sender_.empty() && (within(last_sender_, kInTurns_us) || within(sender, kComesAgain_us))) {
      found = std::min(last_sender_, sender) + " and " + std::max(last_sender_, sender);
    }
    contradicted_us_.clear();
  } else if (stuck) {
    contradicted_us_.clear();
  } else if (against) {
    contradicted_us_.push_back(now_us);
    contradicted_us_.erase(
        std::remove_if(contradicted_us_.begin(), contradicted_us_.end(),
                       [&](std::int64_t then_us) { return between(then_us, now_us) > kContradictions_us; }),
        contradicted_us_.end());
    if (contradicted_us_.size() >= kContradictions) found = "both from " + sender;
  }
  if (heard_us_.size() > 16) heard_us_.clear();
  heard_us_[sender] = now_us;
  last_sender_ = sender;
  if (!same || against || sequence > last_sequence_) {  // What is late is nothing to compare with.
    last_sequence_ = sequence;
    last_time_us_ = time_us;
  }
  return found;
}

SecondSenders::SecondSenders(Bus& bus, std::vector<Watched> watched)
    : watched_(std::move(watched)), watches_(watched_.size()), events_(std::make_shared<std::vector<Event>>()) {
  for (std::size_t i = 0; i < watched_.size(); ++i) {
    const auto note = [&bus, i, box = std::weak_ptr(events_)](const std::uint8_t* data, std::size_t size) {
      const auto events = box.lock();
      constexpr std::size_t kFirstFields_bytes = 24;
      // What is no message of ours is nobody's: it moves nothing and is heard by none.
      if (!events || events->size() >= kMaxEvents || size < kFirstFields_bytes || !messageType(data, size)) return;
      if (size <= kSmall_bytes && !decodeAny(data, size).value) return;
      events->push_back({i, bus.sender(), numberAt(data + 16), numberAt(data + 8)});
    };
    if (watched_[i].kind == Kind::kMachine) {
      bus.subscribe(watched_[i].channel, note);
    } else {
      bus.overhear(watched_[i].channel, note);
    }
  }
}

std::optional<std::string> SecondSenders::take(std::int64_t now_us) {
  std::optional<std::string> found;
  bool loop = false;  // Who says statuses and commands is a loop.
  for (const Event& event : std::exchange(*events_, {})) {
    const Watched& watched = watched_[event.watched];
    const bool machine = watched.kind == Kind::kMachine;
    const auto senders = machine ? watches_[event.watched].hear(event.sender, event.sequence, event.time_us, now_us)
                                 : std::optional(event.sender);
    const bool says_more = watched.kind == Kind::kStatuses && !std::exchange(loop, true);
    if (senders && (!found || says_more)) found = inWords(watched, *senders);
  }
  return found;
}

void SecondSenders::forget() {
  events_->clear();
  for (SenderWatch& watch : watches_) watch = SenderWatch();
}

}  // namespace angio::servo
