// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_node.hpp"

#include <cmath>

#include "angio/messaging/channels.hpp"
#include "angio/servo/perception_node.hpp"

namespace angio {

ServoNode::ServoNode(Bus& bus, const ServoLoopSettings& settings, const VesselTree& tree)
    : bus_(bus), frames_(bus, kXrayFrameChannel), joints_(bus, kCArmStateChannel), loop_(settings, tree) {}

std::optional<ServoReport> ServoNode::answer() {
  if (joints_.empty()) return std::nullopt;
  const auto frame = frames_.take();
  if (!frame) return std::nullopt;
  const CArmState state = *joints_.at(frame->time_us);
  publish(bus_, kServoInputChannel, ServoInput{frame->time_us, frame->sequence, state});
  ServoReport report = loop_.step(*frame, state);
  publish(bus_, kCArmCommandChannel, report.command);
  publish(bus_, kRegistrationChannel, registrationMessage(report));
  publish(bus_, kServoStatusChannel, servoStatus(report));
  return report;
}

RegistrationMessage registrationMessage(const ServoReport& report) {
  return registrationMessage(report.sight.registration, report.command.time_us, report.command.frame_sequence);
}

ServoStatus servoStatus(const ServoReport& report) {
  const auto microseconds = [](double seconds) { return static_cast<std::int64_t>(std::llround(seconds * 1e6)); };
  ServoStatus status;
  status.time_us = report.command.time_us;
  status.frame_sequence = report.command.frame_sequence;
  status.state = report.held ? ServoState::kHold : ServoState::kServo;
  status.reason = report.held.value_or("");
  if (report.task.view_error) {
    status.view_error_rad = report.task.view_error->direction_rad;
    status.target_error_m = report.task.view_error->target_m;
  }
  status.image_us = microseconds(report.sight.image_s);
  status.registration_us = microseconds(report.sight.registration_s);
  status.control_us = microseconds(report.control_s);
  return status;
}

}  // namespace angio
