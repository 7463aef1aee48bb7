// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/types/command_gate.hpp"

#include <algorithm>

namespace angio::types {
namespace {

// In doubles: numbers from the wire may lie further apart than an int64 holds.
double between(std::int64_t from, std::int64_t to) { return static_cast<double>(to) - static_cast<double>(from); }

}  // namespace

bool CommandGate::bound(std::int64_t now_us) const {
  return bound_ && between(bound_->heard_us, now_us) <= static_cast<double>(kSilence_us);
}

std::optional<CommandGate::Refusal> CommandGate::outside(const Command& command, const std::string& sender,
                                                         std::int64_t now_us) const {
  if (!bound(now_us)) return std::nullopt;
  if (!sender.empty() && !bound_->sender.empty() && sender != bound_->sender) return Refusal::kOtherSender;
  const double ticked_us = bound_->time_us ? between(*bound_->time_us, command.time_us) : 0;
  if (command.sequence <= bound_->sequence && (command.sequence == bound_->sequence || ticked_us <= 0)) {
    return Refusal::kLate;
  }
  const bool jumped = between(bound_->sequence, command.sequence) > static_cast<double>(kMaxSequenceJump) ||
                      ticked_us > static_cast<double>(kMaxTimeJump_us);
  return jumped ? std::optional(Refusal::kJumped) : std::nullopt;
}

std::optional<CommandGate::Refusal> CommandGate::refusal(const Command& command, const std::string& sender,
                                                         std::int64_t now_us) const {
  return command.stands_still ? std::nullopt : outside(command, sender, now_us);
}

void CommandGate::obeyed(const Command& command, const std::string& sender, std::int64_t now_us) {
  // A stop from elsewhere is obeyed, and binds nothing: its number may be anything.
  if (command.stands_still && !bound(now_us)) return;
  if (outside(command, sender, now_us)) return;
  bound_ = Bound{sender, command.sequence, command.time_us, now_us};
}

void CommandGate::begin(const ServoSession& session, const std::string& sender, std::int64_t now_us) {
  if (std::find(sessions_.begin(), sessions_.end(), session.session) != sessions_.end()) return;
  sessions_.push_back(session.session);
  if (sessions_.size() > kSessionsKept) sessions_.pop_front();
  bound_ = Bound{sender, session.command_sequence, std::nullopt, now_us};
}

}  // namespace angio::types
