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
  deviation_ = {};
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
    result.most = std::max(result.most, v);
    result.least = std::min(result.least, v);
  }
  if (sent == sent_.rend()) return result;  // Commands have not come for long enough to demand anything.
  result.floor = std::max(0.0, slowest);
  result.ceiling = std::min(0.0, fastest);
  return result;
}

// The integral of the envelope since the last time [rad, m].
AxisMonitor::Envelope AxisMonitor::explainedWay(const Seen& now) {
  Envelope& e = envelope_;
  Envelope way;
  const double a = traits_.acceleration;
  const double up = traits_.upper - std::max(now.place, last_->place);
  const double down = std::min(now.place, last_->place) - traits_.lower;
  const double brake_up = std::sqrt(2 * a * std::max(0.0, up)), brake_down = std::sqrt(2 * a * std::max(0.0, down));
  for (std::int64_t from_us = last_->time_us; from_us < now.time_us;) {
    const std::int64_t to_us = std::min(from_us + kStep_us, now.time_us);
    const double dt_s = 1e-6 * static_cast<double>(to_us - from_us), change = a * dt_s;
    const Envelope goal = target(to_us);
    e.most = std::max(goal.most, approach(e.most, goal.most, change));
    e.least = std::min(goal.least, approach(e.least, goal.least, change));
    // What is demanded has to be reached from wherever the axis may have been.
    e.floor = goal.floor > 0 ? std::min(goal.floor, approach(e.floor, goal.floor, change)) : e.least;
    e.ceiling = goal.ceiling < 0 ? std::max(goal.ceiling, approach(e.ceiling, goal.ceiling, change)) : e.most;
    way.most += e.most * dt_s;
    way.least += e.least * dt_s;
    way.floor += std::min(e.floor, brake_up) * dt_s;
    way.ceiling += std::max(e.ceiling, -brake_down) * dt_s;
    from_us = to_us;
  }
  return way;
}

std::optional<std::string> AxisMonitor::judge(double way, const Envelope& explained, double duration_s) {
  const double forgotten = traits_.deadband_speed * duration_s;
  const auto add = [&](double& sum, double excess) { sum = std::max(0.0, sum + excess - forgotten); };
  add(deviation_.up, way - explained.most);
  add(deviation_.down, explained.least - way);
  add(deviation_.lag_up, explained.floor - way);
  add(deviation_.lag_down, way - explained.ceiling);
  const auto verdict = [&](double sum, double most, const char* what) -> std::optional<std::string> {
    if (sum <= most) return std::nullopt;
    return traits_.name + " " + what + " by " +
           (traits_.angle ? formatValue(radToDeg(sum)) + " deg" : formatValue(1e3 * sum) + " mm");
  };
  if (auto fault = verdict(std::max(deviation_.up, deviation_.down), traits_.max_deviation, "moved uncommanded"))
    return fault;
  return verdict(std::max(deviation_.lag_up, deviation_.lag_down), traits_.max_following_error,
                 "lags behind its commands");
}

std::optional<std::string> AxisMonitor::measured(std::int64_t time_us, double place, double velocity) {
  const Seen now{time_us, place};
  std::optional<std::string> fault;
  if (!last_ || time_us - kMaxGap_us >= last_->time_us) {
    const double most = std::max(0.0, velocity), least = std::min(0.0, velocity);
    envelope_ = {most, least, least, most};
    deviation_ = {};
  } else if (time_us <= last_->time_us) {
    return std::nullopt;
  } else {
    fault = judge(place - last_->place, explainedWay(now), 1e-6 * static_cast<double>(time_us - last_->time_us));
  }
  last_ = now;
  const std::int64_t needed_us = time_us - std::llround(traits_.max_latency_s * 1e6) - kMaxGap_us;
  while (sent_.size() > 1 && sent_[1].time_us < needed_us) sent_.pop_front();
  return fault;
}

}  // namespace angio::servo
