// SPDX-License-Identifier: GPL-2.0-or-later
#include "latency_compensator.hpp"

#include <algorithm>
#include <cmath>

namespace angio::servo {
namespace {

// Joints that go from their velocity to the wanted one with their acceleration.
void follow(CArmJoints& joints, CArmJoints& velocity, const CArmJoints& wanted, const CArmLimits& limits, double dt_s) {
  for (int i = 0; i < kCArmJointCount; ++i) {
    const double change = wanted[i] - velocity[i], a = limits.acceleration[i];
    const double ramp_s = a > 0 ? std::min(std::abs(change) / a, dt_s) : dt_s;
    const double reached = velocity[i] + std::copysign(a * ramp_s, change);
    joints[i] += 0.5 * (velocity[i] + reached) * ramp_s + reached * (dt_s - ramp_s);
    velocity[i] = reached;
  }
}

}  // namespace

CArmState LatencyCompensator::atArrival(const TaskInput& input) {
  const double now_s = 1e-6 * static_cast<double>(input.time_us), from_s = now_s;
  if (interrupted_) commands_.push_back({last_frame_s_ + 1e-6, CArmJoints::Zero()});
  interrupted_ = false;
  last_change_ = input.last_velocity - last_velocity_;
  last_velocity_ = input.last_velocity;
  // A clock that was set back leaves commands of a time to come.
  while (!commands_.empty() && commands_.back().frame_time_s >= now_s) commands_.pop_back();
  commands_.push_back({now_s - input.period_s, input.last_velocity});
  last_frame_s_ = now_s;
  // The newest of those that have come into force by now, and all after it.
  while (commands_.size() > 1 && commands_[1].frame_time_s + input.latency_s <= from_s) commands_.pop_front();

  CArmState then = input.state;
  double at_s = from_s;
  for (std::size_t k = 0; k < commands_.size(); ++k) {
    const double ends_s =
        k + 1 < commands_.size() ? commands_[k + 1].frame_time_s + input.latency_s : now_s + input.latency_s;
    const double begins_s = std::max(at_s, commands_[k].frame_time_s + input.latency_s);
    // Before the oldest one that is known the joints go on as they do.
    if (begins_s > at_s) follow(then.joints, then.velocity, CArmJoints(then.velocity), limits_, begins_s - at_s);
    at_s = begins_s;
    if (ends_s > at_s) follow(then.joints, then.velocity, commands_[k].velocity, limits_, ends_s - at_s);
    at_s = std::max(at_s, ends_s);
  }
  return then;
}

}  // namespace angio::servo
