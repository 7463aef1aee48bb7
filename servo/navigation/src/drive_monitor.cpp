// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/drive_monitor.hpp"

#include <limits>

#include "angio/base/checked.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::navigation {
namespace {

constexpr double kNoEnd = std::numeric_limits<double>::infinity();

AxisTraits traits(const DriveMonitorSettings& s, const char* name, bool angle, double lower, double upper) {
  AxisTraits axis;
  axis.name = name;
  axis.angle = angle;
  axis.lower = lower;
  axis.upper = upper;
  axis.acceleration = angle ? degToRad(s.min_acceleration_deg_per_s2) : 1e-3 * s.min_acceleration_mm_per_s2;
  axis.deadband_speed = angle ? degToRad(s.deadband_deg_per_s) : 1e-3 * s.deadband_mm_per_s;
  axis.max_deviation = angle ? degToRad(s.max_deviation_deg) : 1e-3 * s.max_deviation_mm;
  axis.max_following_error = angle ? degToRad(s.max_following_error_deg) : 1e-3 * s.max_following_error_mm;
  axis.max_latency_s = 1e-3 * s.max_latency_ms;
  return axis;
}

}  // namespace

DriveMonitor::DriveMonitor(const DriveMonitorSettings& settings, double max_bend_rad)
    : insertion_(
          traits(checked("drive monitor", settings), "insertion", false, 0, kNoEnd)),  // Never pulled out further.
      roll_(traits(settings, "roll", true, -kNoEnd, kNoEnd)),
      bend_(traits(settings, "bend", true, 0, max_bend_rad)) {}

void DriveMonitor::forget() {
  for (AxisMonitor* axis : {&insertion_, &roll_, &bend_}) axis->forget();
}

void DriveMonitor::commanded(const CatheterCommand& c) {
  insertion_.commanded(c.time_us, c.valid_for_us, c.insertion_speed_m_per_s);
  roll_.commanded(c.time_us, c.valid_for_us, c.roll_speed_rad_per_s);
  bend_.commanded(c.time_us, c.valid_for_us, c.bend_speed_rad_per_s);
}

std::optional<std::string> DriveMonitor::measured(const CatheterState& s) {
  const auto insertion = insertion_.measured(s.time_us, s.insertion_m, s.insertion_speed_m_per_s);
  const auto roll = roll_.measured(s.time_us, s.roll_rad, s.roll_speed_rad_per_s);
  const auto bend = bend_.measured(s.time_us, s.bend_rad, s.bend_speed_rad_per_s);
  return insertion ? insertion : roll ? roll : bend;
}

}  // namespace angio::navigation
