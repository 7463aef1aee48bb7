// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/drive_monitor.hpp"

#include "angio/geometry/se3.hpp"

namespace angio {
namespace {

AxisTraits traits(const DriveMonitorSettings& s, const char* name, bool angle) {
  AxisTraits axis;
  axis.name = name;
  axis.angle = angle;
  axis.acceleration = angle ? degToRad(s.least_acceleration_deg_s2) : 1e-3 * s.least_acceleration_mm_s2;
  axis.forgotten_speed = angle ? degToRad(s.forgotten_deg_s) : 1e-3 * s.forgotten_mm_s;
  axis.most_stray = angle ? degToRad(s.most_stray_deg) : 1e-3 * s.most_stray_mm;
  axis.most_lag = angle ? degToRad(s.most_lag_deg) : 1e-3 * s.most_lag_mm;
  axis.most_latency_s = 1e-3 * s.most_latency_ms;
  return axis;
}

AxisTraits insertion(const DriveMonitorSettings& s) {
  AxisTraits axis = traits(s, "insertion", false);
  axis.lower = 0;  // It cannot be pulled out further.
  return axis;
}

AxisTraits bend(const DriveMonitorSettings& s, double largest_rad) {
  AxisTraits axis = traits(s, "bend", true);
  axis.lower = 0;
  axis.upper = largest_rad;
  return axis;
}

}  // namespace

DriveMonitor::DriveMonitor(const DriveMonitorSettings& settings, double largest_bend_rad)
    : insertion_((checkSettings("drive monitor", settings), insertion(settings))),
      roll_(traits(settings, "roll", true)),
      bend_(bend(settings, largest_bend_rad)) {}

void DriveMonitor::forget() {
  for (AxisMonitor* axis : {&insertion_, &roll_, &bend_}) axis->forget();
}

void DriveMonitor::commanded(const CatheterCommand& c) {
  insertion_.commanded(c.time_us, c.valid_for_us, c.insertion_speed_mps);
  roll_.commanded(c.time_us, c.valid_for_us, c.roll_speed_radps);
  bend_.commanded(c.time_us, c.valid_for_us, c.bend_speed_radps);
}

std::optional<std::string> DriveMonitor::measured(const CatheterState& s) {
  const auto insertion = insertion_.measured(s.time_us, s.insertion_m, s.insertion_speed_mps);
  const auto roll = roll_.measured(s.time_us, s.roll_rad, s.roll_speed_radps);
  const auto bend = bend_.measured(s.time_us, s.bend_rad, s.bend_speed_radps);
  return insertion ? insertion : roll ? roll : bend;
}

}  // namespace angio
