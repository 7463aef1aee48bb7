// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "angio/types/namespace.hpp"
#include "angio/types/servo_session.hpp"

namespace angio::types {

/// Whose commands a machine obeys, and in which order: the receiving side of CARM_COMMAND and CATHETER_COMMAND.
///
/// - A command that stands still is always obeyed, whoever sent it and whatever its sequence number and time.
/// - A machine is bound to one sender at a time: to that of the last announced session, or else to that of the first
///   command that moves it. It is free again when no command of that sender has come for 1 s.
/// - While it is bound, a command that moves must come from that sender, as far as the bus knows senders, and must be
///   newer than its last one: with a higher sequence number, or with a later time, as of a sender that began again. It
///   must not be more than 1,000 numbers or 10 s ahead, so that no single number locks out those that follow.
/// - A session whose number is new binds the machine to its sender, and its commands follow `command_sequence`.
///
/// Knows no clock: each call says what time it is, by the machine's own clock [us].
class CommandGate {
 public:
  static constexpr std::int64_t kMaxSequenceJump = 1000, kMaxTimeJump_us = 10'000'000, kSilence_us = 1'000'000;

  /// What counts of a command.
  struct Command {
    std::int64_t sequence = 0, time_us = 0;
    bool stands_still = true;
  };

  enum class Refusal { kLate, kJumped, kOtherSender };

  /// Why a command must not be obeyed; nothing when it may be.
  ///
  /// @param sender  As the bus names it (Bus::sender()); empty: unknown.
  std::optional<Refusal> refusal(const Command& command, const std::string& sender, std::int64_t now_us) const;

  /// The command was obeyed.
  void obeyed(const Command& command, const std::string& sender, std::int64_t now_us);

  /// A session was announced.
  void begin(const ServoSession& session, const std::string& sender, std::int64_t now_us);

  /// The sender that the machine is bound to; empty when it is free or the bus does not know senders.
  std::string sender(std::int64_t now_us) const { return bound(now_us) ? bound_->sender : std::string(); }

 private:
  struct Bound {
    std::string sender;
    std::int64_t sequence = 0;
    std::optional<std::int64_t> time_us;  // Of the last command; none before a session's first.
    std::int64_t heard_us = 0;
  };

  bool bound(std::int64_t now_us) const;
  std::optional<Refusal> outside(const Command& command, const std::string& sender, std::int64_t now_us) const;

  static constexpr std::size_t kSessionsKept = 16;

  std::optional<Bound> bound_;
  std::deque<std::int64_t> sessions_;  // Numbers of the last ones, so that none is announced twice.
};

}  // namespace angio::types
