// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_loop.hpp"

#include <algorithm>

#include "angio/base/errors.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/servo/perception_node.hpp"

namespace angio {
namespace {

// Frames further apart than this do not belong to one motion.
constexpr double kLongestPeriod_s = 0.2;
constexpr double kFirstPeriod_s = 1.0 / 15;

// What would otherwise hold the arm frame after frame, or steer it by a matrix that is no rotation.
const ServoLoopSettings& checked(const ServoLoopSettings& settings) {
  const std::string place = "servo loop";
  settings.carm.check();
  if (settings.target_model) {
    for (const double x : *settings.target_model) requireFinite(place, "target_model", x);
  }
  for (const double x : settings.T_dsa_cb.translation()) requireFinite(place, "T_dsa_cb.translation", x);
  requireBetween(place, "latency_s", settings.latency_s, 0, 10);
  const auto rotation = [&](const char* field, const Eigen::Matrix3d& R) {
    const double defect = rotationDefect(R);
    if (!(defect < 1e-6))
      throw InputError(place, field, "R^T R - I up to " + shown(defect), "must be a rotation matrix");
  };
  rotation("T_dsa_cb.rotation", settings.T_dsa_cb.linear());
  rotation("R_lps_model", settings.R_lps_model);
  return settings;
}

// From when the joints were read until the command that answers a frame moves them.
double ageAtArrival_s(std::int64_t frame_us, const CArmState& state, double latency_s) {
  return std::max(0.0, latency_s + 1e-6 * (static_cast<double>(frame_us) - static_cast<double>(state.time_us)));
}

Eigen::Vector3d targetOf(const ServoLoopSettings& settings, const VesselTree& tree) {
  return settings.target_model.value_or(tree.centroid());
}

std::unique_ptr<Task> taskOf(const ServoLoopSettings& settings, const VesselTree& tree) {
  return makeTask(settings.task,
                  {settings.carm, settings.limits, tree, targetOf(settings, tree), settings.R_lps_model, settings.law});
}

}  // namespace

PerceptionSettings ServoLoopSettings::perceptionForTask() const {
  PerceptionSettings settings = perception;
  settings.tracker.follow_motion |= patientMoves(task);
  return settings;
}

ToldOfFrames ServoLoopSettings::toldOfFrames() const {
  const auto* centre = std::get_if<CentreTaskSettings>(&task);
  return {registered_elsewhere, centre != nullptr && centre->on == CentreOn::kCatheterTip};
}

ServoLoop::ServoLoop(const ServoLoopSettings& settings, const VesselTree& tree)
    : settings_(checked(settings)),
      task_(taskOf(settings, tree)),
      perception_(settings.perceptionForTask(), settings.carm, settings.T_dsa_cb, tree, task_->place()),
      supervisor_(settings.supervisor, settings.limits, targetOf(settings, tree), targetNeed(settings.task)) {}

ServoReport ServoLoop::step(const XrayFrame& frame, const CArmState& state, const SeenElsewhere& seen) {
  const double period_s = periodUntil(frame);
  ServoReport report = answer(frame, state, seen, period_s);
  if (report.held) supervisor_.rest(period_s);
  number(report.command, frame);
  return report;
}

// Zero when time stood still or went back.
double ServoLoop::periodUntil(const XrayFrame& frame) {
  const double now_us = static_cast<double>(frame.time_us);
  const double period_s =
      last_frame_us_ ? std::max(0.0, 1e-6 * (now_us - static_cast<double>(*last_frame_us_))) : kFirstPeriod_s;
  last_frame_us_ = frame.time_us;
  return period_s;
}

ServoReport ServoLoop::refuse(const XrayFrame& frame, const std::string& why) {
  ServoReport report;
  report.held = why;
  task_->interrupt();
  // Its time may be what is wrong with it: no period is taken from there.
  supervisor_.rest(0);
  number(report.command, frame);
  return report;
}

void ServoLoop::takeBack(ServoReport& last_answer, const std::string& why) {
  last_answer.command.velocity.setZero();
  last_answer.task = {};
  last_answer.held = why;
  supervisor_.takeBack();
  last_command_ = last_answer.command;
}

void ServoLoop::learn() {
  perception_.learn();
  task_->learn();
}

void ServoLoop::number(CArmCommand& command, const XrayFrame& frame) {
  command.time_us = frame.time_us;
  command.frame_sequence = frame.sequence;
  command.sequence = last_command_.sequence + 1;
  command.valid_for_us = supervisor_.commandValidity_us();
  last_command_ = command;
}

std::optional<std::string> ServoLoop::objection(const SeenElsewhere& seen) const {
  if (!settings_.registered_elsewhere) return std::nullopt;
  if (!seen.registration) return "nobody has registered the frame";
  const bool converged = seen.registration->status == static_cast<std::int8_t>(RegistrationStatus::kConverged);
  if (converged && seen.registration->model_id != perception_.modelId()) {
    return "what was registered is another vessel tree";
  }
  return std::nullopt;
}

std::optional<std::string> ServoLoop::objectionToTip(const SeenElsewhere& seen) const {
  if (!seen.tip) return "the catheter's tip is not located";
  if (seen.tip->status != CatheterTipStatus::kLocated) return "the catheter's tip is not located: " + seen.tip->reason;
  if (seen.tip->model_id != perception_.modelId()) return "the catheter's tip was located in another vessel tree";
  return std::nullopt;
}

// The command's velocity is zero unless the last line is reached.
ServoReport ServoLoop::answer(const XrayFrame& frame, const CArmState& state, const SeenElsewhere& seen,
                              double period_s) {
  ServoReport report;
  report.held = supervisor_.objection(frame, state);
  if (!report.held) report.held = objection(seen);
  if (report.held) {
    task_->interrupt();
    return report;
  }
  report.sight = settings_.registered_elsewhere ? perception_.take(registrationResult(*seen.registration), state)
                                                : perception_.look(frame, state);

  const Stopwatch control;
  const Sight& sight = report.sight;
  report.held = supervisor_.objection(sight.registration, perception_.calibrated_T_camera_model(state.joints),
                                      sight.tracked ? std::optional(sight.predicted.T_camera_model) : std::nullopt);
  if (report.held) {
    perception_.doubt();
    task_->interrupt();
    return report;
  }
  perception_.trust(sight, state);
  TaskInput input{frame.time_us,
                  frame.camera,
                  sight.registration.T_camera_model,
                  *sight.registration.covariance,
                  perception_.tracked_T_camera_model(state.joints),
                  state,
                  last_command_.velocity,
                  std::min(period_s, kLongestPeriod_s),
                  settings_.latency_s};
  input.place = sight.place;
  if (task_->followsTip()) {
    report.held = objectionToTip(seen);
    if (report.held) {
      report.tip_unknown = true;
      task_->interrupt();
      return report;
    }
    input.target_model = seen.tip->tip_model;
    input.target_covariance = seen.tip->covariance;
  }
  const TaskAnswer answer = task_->answer(input);
  if (!answer.velocity) {
    report.held = answer.held.value_or("the task asks for no motion");
    return report;
  }
  report.task = answer;
  report.command.velocity =
      supervisor_.limit(*answer.velocity, state, ageAtArrival_s(frame.time_us, state, settings_.latency_s), period_s);
  report.control_s = control.seconds();
  return report;
}

OpenLoop::OpenLoop(const ServoLoopSettings& settings, const VesselTree& tree)
    : settings_(checked(settings)),
      task_(taskOf(settings, tree)),
      supervisor_(settings.supervisor, settings.limits, targetOf(settings, tree)) {}

CArmCommand OpenLoop::step(const CArmState& state, double period_s) {
  CArmCommand command;
  command.time_us = state.time_us;
  command.sequence = last_command_.sequence + 1;
  command.valid_for_us = supervisor_.commandValidity_us();
  const Pose believed = settings_.carm.T_camera_patient(state.joints) * settings_.T_dsa_cb;
  const TaskInput input{state.time_us, settings_.carm.camera(), believed, Matrix6d::Zero(),   believed,
                        state,         last_command_.velocity,  period_s, settings_.latency_s};
  const TaskAnswer answer = task_->answer(input);
  if (answer.velocity) {
    command.velocity = supervisor_.limit(*answer.velocity, state, settings_.latency_s, period_s);
  } else {
    supervisor_.rest(period_s);
  }
  last_command_ = command;
  return command;
}

}  // namespace angio
