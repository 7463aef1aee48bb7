// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/motion_monitor.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "angio/base/errors.hpp"

namespace angio {
namespace {

constexpr std::int64_t kStep_us = 10'000, kLongestGap_us = 1'000'000;
constexpr std::size_t kMostCommands = 1024;
constexpr const char* kJointNames[kCArmJointCount] = {"primary", "secondary", "table x", "table y", "table z"};

bool isAngle(int joint) { return joint < 2; }

// Towards `goal`, no faster than `most_change`.
double approach(double value, double goal, double most_change) {
  return value + std::clamp(goal - value, -most_change, most_change);
}

}  // namespace

MotionMonitor::MotionMonitor(const MotionMonitorSettings& settings, const CArmLimits& limits)
    : settings_(settings), limits_(limits) {
  checkSettings("motion monitor", settings_);
}

void MotionMonitor::forget() {
  sent_.clear();
  last_.reset();
  envelopes_ = {};
  astray_ = {};
}

void MotionMonitor::commanded(const CArmCommand& command) {
  const std::int64_t time_us = sent_.empty() ? command.time_us : std::max(command.time_us, sent_.back().time_us);
  sent_.push_back({time_us, command.valid_for_us, command.velocity});
  if (sent_.size() > kMostCommands) sent_.pop_front();
}

// What the commands that may be in force at a time say; rest is one of them.
MotionMonitor::Envelope MotionMonitor::target(int joint, std::int64_t time_us) const {
  Envelope result;
  const std::int64_t since_us = time_us - std::llround(settings_.most_latency_ms * 1e3);
  double slowest = std::numeric_limits<double>::infinity(), fastest = -slowest;
  std::int64_t covered_until_us = std::numeric_limits<std::int64_t>::max();
  auto sent = sent_.rbegin();
  for (; sent != sent_.rend(); ++sent) {
    if (sent->time_us > time_us) continue;
    // One that had run out before the next came, or now, lets the machine rest.
    const std::int64_t next_us = std::min(covered_until_us, time_us);
    const bool gap = next_us - sent->time_us > sent->valid_for_us;
    const double v = sent->velocity[joint];
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

// The integral of the envelope since the last state [rad, m].
MotionMonitor::Envelope MotionMonitor::explainedWay(int joint, const CArmState& state) {
  Envelope& e = envelopes_[static_cast<std::size_t>(joint)];
  Envelope way;
  const double a = settings_.least_acceleration * limits_.acceleration[joint];
  const double up = limits_.upper[joint] - std::max(state.joints[joint], last_->joints[joint]);
  const double down = std::min(state.joints[joint], last_->joints[joint]) - limits_.lower[joint];
  const double brake_up = std::sqrt(2 * a * std::max(0.0, up)), brake_down = std::sqrt(2 * a * std::max(0.0, down));
  for (std::int64_t from_us = last_->time_us; from_us < state.time_us;) {
    const std::int64_t to_us = std::min(from_us + kStep_us, state.time_us);
    const double dt_s = 1e-6 * static_cast<double>(to_us - from_us), change = a * dt_s;
    const Envelope goal = target(joint, to_us);
    e.most = std::max(goal.most, approach(e.most, goal.most, change));
    e.least = std::min(goal.least, approach(e.least, goal.least, change));
    // What is demanded has to be reached from wherever the joint may have been.
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

std::optional<std::string> MotionMonitor::judge(int joint, double way, const Envelope& explained, double duration_s) {
  Astray& astray = astray_[static_cast<std::size_t>(joint)];
  const double forgotten = settings_.forgotten_share * limits_.velocity[joint] * duration_s;
  const auto add = [&](double& sum, double excess) { sum = std::max(0.0, sum + excess - forgotten); };
  add(astray.up, way - explained.most);
  add(astray.down, explained.least - way);
  add(astray.lag_up, explained.floor - way);
  add(astray.lag_down, way - explained.ceiling);
  const double unit = isAngle(joint) ? kPi / 180 : 1e-3;
  const auto verdict = [&](double sum, double most, const char* what) -> std::optional<std::string> {
    if (sum <= most * unit) return std::nullopt;
    return std::string(kJointNames[joint]) + " " + what + " by " + shown(sum / unit) +
           (isAngle(joint) ? " deg" : " mm");
  };
  const double most_stray = isAngle(joint) ? settings_.most_stray_deg : settings_.most_stray_mm;
  const double most_lag = isAngle(joint) ? settings_.most_lag_deg : settings_.most_lag_mm;
  if (auto fault = verdict(std::max(astray.up, astray.down), most_stray, "moved uncommanded")) return fault;
  return verdict(std::max(astray.lag_up, astray.lag_down), most_lag, "lags behind its commands");
}

std::optional<std::string> MotionMonitor::measured(const CArmState& state) {
  const bool anew = !last_ || state.time_us - kLongestGap_us >= last_->time_us;
  if (!anew && state.time_us <= last_->time_us) return std::nullopt;
  std::optional<std::string> fault;
  for (int i = 0; i < kCArmJointCount; ++i) {
    if (anew) {
      const double most = std::max(0.0, state.velocity[i]), least = std::min(0.0, state.velocity[i]);
      envelopes_[static_cast<std::size_t>(i)] = {most, least, least, most};
      astray_[static_cast<std::size_t>(i)] = {};
      continue;
    }
    const double duration_s = 1e-6 * static_cast<double>(state.time_us - last_->time_us);
    const auto wrong = judge(i, state.joints[i] - last_->joints[i], explainedWay(i, state), duration_s);
    if (!fault) fault = wrong;
  }
  last_ = state;
  const std::int64_t needed_us = state.time_us - std::llround(settings_.most_latency_ms * 1e3) - kLongestGap_us;
  while (sent_.size() > 1 && sent_[1].time_us < needed_us) sent_.pop_front();
  return fault;
}

}  // namespace angio
