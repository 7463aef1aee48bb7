// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/messaging/channels.hpp"
#include "angio/messaging/mailbox.hpp"

namespace angio {

/// A person's side of a bus: hears SERVO_STATUS and says SERVO_REQUEST, each request with the status that was seen when
/// it was made.
class Operator {
 public:
  /// Borrows the bus, which must outlive it.
  explicit Operator(Bus& bus) : bus_(bus), statuses_(bus, kServoStatusChannel) {}

  /// The newest status; nothing when none has come yet.
  const std::optional<ServoStatus>& status() const { return statuses_.peek(); }

  /// Makes a request. @param now_us  The operator's clock [us].
  void ask(ServoRequestKind kind, std::int64_t now_us);

  /// Arms and starts the loop, step by step with each call, waiting for an answer in between, and asking again where
  /// none comes. Once it has started, or has been stopped on the way, no call does anything more: a fault is for a
  /// person to look at.
  void start(std::int64_t now_us);

 private:
  Bus& bus_;
  LatestValue<ServoStatus> statuses_;
  std::int64_t sequence_ = 0;
  std::optional<std::int64_t> asked_us_;
  bool armed_ = false, done_ = false;  // Of start().
};

}  // namespace angio
