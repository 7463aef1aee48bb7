// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/rehearsal/command_observer.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/formatted.hpp"

namespace angio {
namespace {

// Of a speed limit: rounding of velocities that are integrated piece by piece.
constexpr double kRounding = 1e-6;
// Of an acceleration limit: what a machine that has nothing to go by must brake with at least.
constexpr double kLeastBraking = 0.9;
constexpr std::int64_t kRemembered_us = 3'000'000;

}  // namespace

void CommandObserver::exposed(std::int64_t frame_sequence, std::int64_t now_us,
                              const std::optional<std::string>& spoilt) {
  frames_[frame_sequence] = {now_us, spoilt};
}

void CommandObserver::arrived(const CArmCommand& command, std::int64_t now_us) {
  Order order{command, now_us, now_us + std::clamp<std::int64_t>(command.valid_for_us, 0, 1'000'000), std::nullopt};
  const auto frame = frames_.find(command.frame_sequence);
  if (frame == frames_.end()) {
    order.wrong = "by no frame at all";
  } else if (frame->second.spoilt) {
    order.wrong = "by a frame that was " + *frame->second.spoilt;
  } else {
    const double age_s = 1e-6 * static_cast<double>(now_us - frame->second.time_us);
    if (age_s > most_age_s_) order.wrong = formatted("by a frame of %.0f ms before", 1e3 * age_s);
  }
  if (order.wrong && !command.velocity.isZero(0)) ++unsound_;
  orders_.push_back(order);
  while (!orders_.empty() && orders_.front().until_us < now_us - kRemembered_us) orders_.pop_front();
}

bool CommandObserver::explained(int joint, double speed, double sign, std::int64_t from_us, std::int64_t to_us) const {
  return std::any_of(orders_.begin(), orders_.end(), [&](const Order& order) {
    return !order.wrong && order.arrived_us <= to_us && order.until_us >= from_us &&
           sign * order.command.velocity[joint] >= speed - kRounding * limits_.velocity[joint];
  });
}

std::string CommandObserver::suspect(int joint, double sign) const {
  for (auto order = orders_.rbegin(); order != orders_.rend(); ++order) {
    if (order->wrong && sign * order->command.velocity[joint] > 0) return *order->wrong;
  }
  return "by no command";
}

void CommandObserver::see(const CArmState& state) {
  if (last_ && !breach_ && state.time_us > last_->time_us) {
    const double dt_s = 1e-6 * static_cast<double>(state.time_us - last_->time_us);
    for (int i = 0; i < kCArmJointCount; ++i) {
      const double v = state.velocity[i], sign = v < 0 ? -1 : 1, before = std::max(0.0, sign * last_->velocity[i]);
      const double braked = std::max(0.0, before - kLeastBraking * limits_.acceleration[i] * dt_s);
      if (std::abs(v) <= braked + kRounding * limits_.velocity[i]) continue;
      if (explained(i, std::abs(v), sign, last_->time_us, state.time_us)) continue;
      breach_ = formatted("joint %d moved at %.4g [rad/s, m/s] %s", i, v, suspect(i, sign).c_str());
      break;
    }
  }
  last_ = state;
}

}  // namespace angio
