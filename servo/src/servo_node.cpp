// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_node.hpp"

#include <cmath>
#include <utility>

#include "angio/base/stopwatch.hpp"
#include "angio/messaging/channels.hpp"
#include "angio/servo/perception_node.hpp"

namespace angio {

ServoNode::ServoNode(Bus& bus, const ServoLoopSettings& settings, const VesselTree& tree)
    : bus_(bus),
      carm_(settings.carm),
      frames_(bus, settings.toldOfFrames()),
      newest_joints_(bus, kCArmStateChannel),
      requests_(bus, OperatedMachine::kCArm),
      joints_(bus, kCArmStateChannel),
      loop_(settings, tree),
      safety_(settings.safety, settings.limits, settings.target_model.value_or(tree.centroid())) {}

void ServoNode::hear(std::int64_t now_us) {
  if (const auto state = newest_joints_.take()) safety_.observe(*state, now_us);
  for (const ServoRequest& request : requests_.take()) {
    const bool refused = safety_.request(request, now_us).has_value();
    if (!refused && request.request == ServoRequestKind::kReset) joints_.forget();
  }
  safety_.wait(now_us);
}

void ServoNode::judge(const ServoReport& report, const CArmState& state, std::int64_t now_us) {
  const RegistrationResult& seen = report.sight.registration;
  if (!report.held) {
    const Pose T_patient_camera = carm_.T_camera_patient(state.joints).inverse();
    safety_.trust(T_patient_camera * seen.T_camera_model, T_patient_camera.linear().col(2), now_us);
  } else {
    const bool contradicts = seen.status == RegistrationStatus::kConverged && !report.tip_unknown;
    safety_.doubt(contradicts ? SafetySupervisor::Doubt::kContradiction : SafetySupervisor::Doubt::kUnseen,
                  *report.held, now_us);
  }
}

void ServoNode::say(ServoStatus status) {
  safety_.describe(status);
  publish(bus_, kServoStatusChannel, status);
  said_transitions_ = status.transitions;
  last_status_ = std::move(status);
}

// Says on the way what a replay needs to know.
ServoReport ServoNode::answerOf(const ToldFrame& told, const CArmState& state, std::int64_t now_us) {
  const XrayFrame& frame = told.frame;
  const auto note = [&](ServoVerdict verdict) {
    publish(bus_, kServoInputChannel, ServoInput{frame.time_us, frame.sequence, state, verdict});
  };
  if (const auto objection = safety_.begin(frame, now_us)) {
    note(ServoVerdict::kRefused);
    return loop_.refuse(frame, *objection);
  }
  ServoReport report = loop_.step(frame, state, told.seen);
  judge(report, state, now_us);
  const bool may = safety_.moves() && safety_.permitted(report.command.velocity) == report.command.velocity;
  note(may ? ServoVerdict::kPermitted : ServoVerdict::kTakenBack);
  if (!may) loop_.takeBack(report, report.held.value_or(safety_.states().reason()));
  return report;
}

std::optional<ServoReport> ServoNode::answer(std::int64_t now_us) {
  hear(now_us);
  const auto told = joints_.empty() ? std::nullopt : frames_.take();
  if (!told) {
    if (safety_.states().transitions() != said_transitions_) say(last_status_);
    return std::nullopt;
  }
  const CArmState state = *joints_.at(told->frame.time_us);
  ServoReport report = answerOf(*told, state, now_us);
  safety_.commanded(report.command);
  publish(bus_, kCArmCommandChannel, report.command);
  if (!told->seen.registration) publish(bus_, kRegistrationChannel, registrationMessage(report));
  say(servoStatus(report));
  const Stopwatch learning;
  loop_.learn();  // With the command on its way.
  report.learning_s = learning.seconds();
  return report;
}

RegistrationMessage registrationMessage(const ServoReport& report) {
  return registrationMessage(report.sight.registration, report.sight.model_id, report.command.time_us,
                             report.command.frame_sequence);
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
