// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/operator.hpp"

#include <algorithm>

namespace angio::servo {
namespace {

constexpr std::int64_t kPatience_us = 150'000;  // Two frames: so long an answer may take.

}  // namespace

HeardRequests::HeardRequests(Bus& bus, OperatedMachine machine)
    : own_(bus, machine == OperatedMachine::kCArm ? kServoRequestChannel : kCatheterRequestChannel),
      others_(bus, machine == OperatedMachine::kCArm ? kCatheterRequestChannel : kServoRequestChannel) {}

std::vector<ServoRequest> HeardRequests::take() {
  std::vector<ServoRequest> requests = own_.take();
  // Behind its own: an arming that came with a stop must not outlast it.
  for (const ServoRequest& request : others_.take()) {
    if (request.request == ServoRequestKind::kEmergencyStop) requests.push_back(request);
  }
  return requests;
}

void Operator::ask(ServoRequestKind kind, std::int64_t now_us) {
  ServoRequest request;
  request.request = kind;
  request.time_us = now_us;
  // By the clock, so that the next program that asks does not begin again below the last one.
  request.sequence = sequence_ = std::max(sequence_ + 1, now_us);
  if (status()) {
    request.status_time_us = status()->time_us;
    request.transitions = status()->transitions;
  }
  publish(bus_, requests_, request);
  asked_us_ = now_us;
}

void Operator::start(std::int64_t now_us) {
  if (done_ || (asked_us_ && now_us - *asked_us_ < kPatience_us)) return;
  const ServoState state = status() ? status()->state : ServoState::kIdle;
  done_ = state == ServoState::kIdle ? armed_ : state != ServoState::kArmed;
  if (done_) return;
  armed_ = state == ServoState::kArmed;
  // Again, when it was refused: the status it answered may have been from before the first frame.
  ask(armed_ ? ServoRequestKind::kStart : ServoRequestKind::kArm, now_us);
}

}  // namespace angio::servo
