// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_node.hpp"

#include <cmath>

#include "angio/messaging/channels.hpp"

namespace angio {

ServoNode::ServoNode(Bus& bus, const ServoLoopSettings& settings, const VesselTree& tree)
    : bus_(bus), frames_(bus, kXrayFrameChannel), joints_(bus, kCArmStateChannel), loop_(settings, tree) {}

std::optional<ServoReport> ServoNode::answer() {
  if (joints_.empty()) return std::nullopt;
  const auto frame = frames_.take();
  if (!frame) return std::nullopt;
  ServoReport report = loop_.step(*frame, *joints_.at(frame->time_us));
  publish(bus_, kCArmCommandChannel, report.command);
  publish(bus_, kRegistrationChannel, registrationMessage(report));
  publish(bus_, kServoStatusChannel, servoStatus(report));
  return report;
}

RegistrationMessage registrationMessage(const ServoReport& report) {
  const RegistrationResult& seen = report.registration;
  RegistrationMessage message;
  message.time_us = report.command.time_us;
  message.frame_sequence = report.command.frame_sequence;
  message.status = static_cast<std::int8_t>(seen.status);
  message.status_text = statusName(seen.status);
  // What cannot go on the wire stays at rest: a poor image must not end the loop that reports it, and the status says
  // that the pose means nothing.
  if (seen.T_camera_model.matrix().allFinite()) message.T_camera_model = seen.T_camera_model;
  if (seen.covariance && seen.covariance->allFinite() && seen.covariance->diagonal().minCoeff() >= 0) {
    message.covariance = *seen.covariance;
  }
  if (std::isfinite(seen.agreement.model_residual_px)) message.mean_residual_px = seen.agreement.model_residual_px;
  message.points_3d = seen.points_3d;
  message.points_2d = seen.points_2d;
  return message;
}

ServoStatus servoStatus(const ServoReport& report) {
  const auto microseconds = [](double seconds) { return static_cast<std::int64_t>(std::llround(seconds * 1e6)); };
  ServoStatus status;
  status.time_us = report.command.time_us;
  status.frame_sequence = report.command.frame_sequence;
  status.state = report.held ? ServoState::kHold : ServoState::kServo;
  status.reason = report.held.value_or("");
  if (report.view_error) {
    status.view_error_rad = report.view_error->direction_rad;
    status.target_error_m = report.view_error->target_m;
  }
  status.image_us = microseconds(report.image_s);
  status.registration_us = microseconds(report.registration_s);
  status.control_us = microseconds(report.control_s);
  return status;
}

}  // namespace angio
