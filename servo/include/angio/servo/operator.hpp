// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/messaging/mailbox.hpp"
#include "angio/servo/namespace.hpp"
#include "angio/types/channels.hpp"

namespace angio::servo {

/// Whose loop is operated.
enum class OperatedMachine { kCArm, kCatheter };

/// A person's side of a bus: hears a loop's status, SERVO_STATUS or CATHETER_STATUS, and says SERVO_REQUEST or
/// CATHETER_REQUEST, each request with the status that was seen when it was made. An emergency stop is for every loop
/// that hears either.
class Operator {
 public:
  /// Borrows the bus, which must outlive it.
  explicit Operator(Bus& bus, OperatedMachine machine = OperatedMachine::kCArm)
      : bus_(bus),
        requests_(machine == OperatedMachine::kCArm ? kServoRequestChannel : kCatheterRequestChannel),
        statuses_(bus, machine == OperatedMachine::kCArm ? kServoStatusChannel : kCatheterStatusChannel) {}

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
  std::string requests_;  // The channel's name.
  LatestMessage<ServoStatus> statuses_;
  std::int64_t sequence_ = 0;
  std::optional<std::int64_t> asked_us_;
  bool armed_ = false, done_ = false;  // Of start().
};

/// A loop's ear for its operators: all requests of its own channel, and of the other machine's the emergency stops.
class HeardRequests {
 public:
  /// Throws InputError as Bus::subscribe() does.
  HeardRequests(Bus& bus, OperatedMachine machine);

  /// What has come since the last call, in its order.
  std::vector<ServoRequest> take();

 private:
  MessageQueue<ServoRequest> own_, others_;
};

}  // namespace angio::servo
