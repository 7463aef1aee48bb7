// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/motion_monitor.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::servo {
namespace {

constexpr std::int64_t kStep_us = 10'000, kMaxGap_us = 1'000'000;
constexpr std::size_t kMaxCommands = 1024;

// Towards `goal`, no faster than `max_change`.
double approach(double value, double goal, double max_change) {
  return value + std::clamp(goal - value, -max_change, max_change);
}

}  // namespace

MotionMonitor::MotionMonitor(const MotionMonitorSettings& settings, const CArmLimits& limits) {
  checkSettings("motion monitor", settings);
  for (int i = 0; i < kCArmJointCount; ++i) {
    AxisTraits joint;
    joint.name = kJointNames[i];
    joint.angle = i < 2;
    joint.lower = limits.lower[i];
    joint.upper = limits.upper[i];
    joint.acceleration = settings.min_acceleration * limits.acceleration[i];
    joint.deadband_speed = settings.deadband_share * limits.velocity[i];
    joint.max_deviation = joint.angle ? degToRad(settings.max_deviation_deg) : 1e-3 * settings.max_deviation_mm;
    joint.max_following_error =
        joint.angle ? degToRad(settings.max_following_error_deg) : 1e-3 * settings.max_following_error_mm;
    joint.max_latency_s = 1e-3 * settings.max_latency_ms;
    joints_.emplace_back(joint);
  }
}

void MotionMonitor::forget() {
  for (AxisMonitor& joint : joints_) joint.forget();
}

void MotionMonitor::commanded(const CArmCommand& command) {
  for (int i = 0; i < kCArmJointCount; ++i) {
    joints_[static_cast<std::size_t>(i)].commanded(command.time_us, command.valid_for_us, command.velocity[i]);
  }
}

std::optional<std::string> MotionMonitor::measured(const CArmState& state) {
  std::optional<std::string> fault;
  for (int i = 0; i < kCArmJointCount; ++i) {
    const auto wrong = joints_[static_cast<std::size_t>(i)].measured(state.time_us, state.joints[i], state.velocity[i]);
    if (!fault) fault = wrong;
  }
  return fault;
}

void AxisMonitor::forget() {
  sent_.clear();
  last_.reset();
  envelope_ = {};
  excess_ = {};
}

void AxisMonitor::commanded(std::int64_t time_us, std::int64_t valid_for_us, double velocity) {
  sent_.push_back({sent_.empty() ? time_us : std::max(time_us, sent_.back().time_us), valid_for_us, velocity});
  if (sent_.size() > kMaxCommands) sent_.pop_front();
}

// What the commands that may be in force at a time say; rest is one of them.
AxisMonitor::Envelope AxisMonitor::target(std::int64_t time_us) const {
  Envelope result;
  const std::int64_t since_us = time_us - std::llround(traits_.max_latency_s * 1e6);
  double slowest = std::numeric_limits<double>::infinity(), fastest = -slowest;
  std::int64_t covered_until_us = std::numeric_limits<std::int64_t>::max();
  auto sent = sent_.rbegin();
  for (; sent != sent_.rend(); ++sent) {
    if (sent->time_us > time_us) continue;
    // One that had run out before the next came, or now, lets the machine rest.
    const std::int64_t next_us = std::min(covered_until_us, time_us);
    const bool gap = next_us - sent->time_us > sent->valid_for_us;
    const double v = sent->velocity;
    slowest = std::min(slowest, gap ? std::min(v, 0.0) : v);
    fastest = std::max(fastest, gap ? std::max(v, 0.0) : v);
    covered_until_us = sent->time_us;
    if (sent->time_us < since_us) break;  // The one that was in force when the window began: it must, but may not.
    result.max = std::max(result.max, v);
    result.min = std::min(result.min, v);
  }
  if (sent == sent_.rend()) return result;  // Commands have not come for long enough to demand anything.
  result.floor = std::max(0.0, slowest);
  result.ceiling = std::min(0.0, fastest);
  return result;
}

// The integral of the envelope since the last time [rad, m].
AxisMonitor::Envelope AxisMonitor::explainedMotion(const Seen& now) {
  Envelope& e = envelope_;
  Envelope motion;
  const double a = traits_.acceleration;
  const double up = traits_.upper - std::max(now.place, last_->place);
  const double down = std::min(now.place, last_->place) - traits_.lower;
  const double brake_up = std::sqrt(2 * a * std::max(0.0, up)), brake_down = std::sqrt(2 * a * std::max(0.0, down));
  for (std::int64_t from_us = last_->time_us; from_us < now.time_us;) {
    const std::int64_t to_us = std::min(from_us + kStep_us, now.time_us);
    const double dt_s = 1e-6 * static_cast<double>(to_us - from_us), change = a * dt_s;
    const Envelope goal = target(to_us);
    e.max = std::max(goal.max, approach(e.max, goal.max, change));
    e.min = std::min(goal.min, approach(e.min, goal.min, change));
    // What is demanded has to be reached from wherever the axis may have been.
    e.floor = goal.floor > 0 ? std::min(goal.floor, approach(e.floor, goal.floor, change)) : e.min;
    e.ceiling = goal.ceiling < 0 ? std::max(goal.ceiling, approach(e.ceiling, goal.ceiling, change)) : e.max;
    motion.max += e.max * dt_s;
    motion.min += e.min * dt_s;
    motion.floor += std::min(e.floor, brake_up) * dt_s;
    motion.ceiling += std::max(e.ceiling, -brake_down) * dt_s;
    from_us = to_us;
  }
  return motion;
}

std::optional<std::string> AxisMonitor::classify(double motion, const Envelope& explained, double duration_s) {
  const double deadband = traits_.deadband_speed * duration_s;
  const auto add = [&](double& sum, double excess) { sum = std::max(0.0, sum + excess - deadband); };
  add(excess_.deviation_up, motion - explained.max);
  add(excess_.deviation_down, explained.min - motion);
  add(excess_.following_error_up, explained.floor - motion);
  add(excess_.following_error_down, motion - explained.ceiling);
  const auto verdict = [&](double sum, double max, const char* what) -> std::optional<std::string> {
    if (sum <= max) return std::nullopt;
    return traits_.name + " " + what + " by " +
           (traits_.angle ? formatValue(radToDeg(sum)) + " deg" : formatValue(1e3 * sum) + " mm");
  };
  if (auto fault =
          verdict(std::max(excess_.deviation_up, excess_.deviation_down), traits_.max_deviation, "moved uncommanded"))
    return fault;
  return verdict(std::max(excess_.following_error_up, excess_.following_error_down), traits_.max_following_error,
                 "lags behind its commands");
}

std::optional<std::string> AxisMonitor::measured(std::int64_t time_us, double place, double velocity) {
  const Seen now{time_us, place};
  std::optional<std::string> fault;
  if (!last_ || time_us - kMaxGap_us >= last_->time_us) {
    const double min = std::min(0.0, velocity), max = std::max(0.0, velocity);
    envelope_ = {min, max, min, max};
    excess_ = {};
  } else if (time_us <= last_->time_us) {
    return std::nullopt;
  } else {
    fault = classify(place - last_->place, explainedMotion(now), 1e-6 * static_cast<double>(time_us - last_->time_us));
  }
  last_ = now;
  const std::int64_t needed_us = time_us - std::llround(traits_.max_latency_s * 1e6) - kMaxGap_us;
  while (sent_.size() > 1 && sent_[1].time_us < needed_us) sent_.pop_front();
  return fault;
}

}  // namespace angio::servo
