// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_node.hpp"

#include <cmath>

#include "angio/registration/message_conversion.hpp"

namespace angio::servo {

SafetySupervisor<MotionMonitor> NodeTraits<ServoLoop>::safety(const ServoLoop& loop) {
  const ServoLoopSettings& s = loop.settings();
  return {s.safety, s.limits, loop.target_model(), MotionMonitor(s.safety.motion, s.limits)};
}

void NodeTraits<ServoLoop>::publish(Bus& bus, const ServoLoop& loop, const ServoReport& report, ServoState) {
  if (report.observed && !loop.settings().external_registration) {
    angio::servo::publish(bus, kRegistrationChannel, registrationMessage(report));
  }
}

ServoStatus NodeTraits<ServoLoop>::status(const ServoReport& report) { return servoStatus(report); }

RegistrationMessage registrationMessage(const ServoReport& report) {
  return registrationMessage(report.observation.registration, report.observation.model_id, report.command.time_us,
                             report.command.frame_sequence);
}

ServoStatus servoStatus(const ServoReport& report) {
  const auto microseconds = [](double seconds) { return static_cast<std::int64_t>(std::llround(seconds * 1e6)); };
  ServoStatus status;
  status.time_us = report.command.time_us;
  status.frame_sequence = report.command.frame_sequence;
  status.state = report.hold_reason ? ServoState::kHold : ServoState::kServo;
  status.reason = report.hold_reason.value_or(report.task.remark.value_or(""));
  if (report.task.view_error) {
    status.view_error_rad = report.task.view_error->direction_rad;
    status.target_error_m = report.task.view_error->target_m;
  } else if (report.task.target_off_m) {
    status.target_error_m = *report.task.target_off_m;
  }
  if (report.view.reached) status.view_reached_us = report.view.request_us;
  status.image_us = microseconds(report.observation.image_s);
  status.registration_us = microseconds(report.observation.registration_s);
  status.control_us = microseconds(report.control_s);
  return status;
}

}  // namespace angio::servo
