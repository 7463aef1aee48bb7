// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/motion_monitor.hpp"

namespace angio::servo {
namespace {

constexpr const char* kJointNames[kCArmJointCount] = {"primary", "secondary", "table x", "table y", "table z"};

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

}  // namespace angio::servo
