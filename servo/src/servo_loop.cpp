// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_loop.hpp"

#include <algorithm>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/registration/message_conversion.hpp"
#include "angio/vessel/resample.hpp"

namespace angio::servo {
namespace {

// Frames further apart than this do not belong to one motion.
constexpr double kMaxPeriod_s = 0.2;
constexpr double kFirstPeriod_s = 1.0 / 15;
// A place of another tree, or in other units, is far from this one.
constexpr double kMaxBesideTree_m = 50e-3;

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
      throw InputError(place, field, "R^T R - I up to " + formatValue(defect), "must be a rotation matrix");
  };
  const bool resolves = settings.depth_first || std::holds_alternative<ResolveDepthTaskSettings>(settings.task);
  if (resolves && settings.external_registration) {
    throw InputError(place, "perception", "bus",
                     "must be own for resolve_depth: REGISTRATION does not say what was matched");
  }
  rotation("T_dsa_cb.rotation", settings.T_dsa_cb.linear());
  rotation("R_lps_model", settings.R_lps_model);
  return settings;
}

// From when the joints were read until the command that answers a frame moves them.
double ageAtArrival_s(std::int64_t frame_us, const CArmState& state, double latency_s) {
  return std::max(0.0, latency_s + 1e-6 * (static_cast<double>(frame_us) - static_cast<double>(state.time_us)));
}

std::unique_ptr<Task> taskOf(const ServoLoopSettings& settings, const VesselTree& tree) {
  const TaskContext context{settings.carm,        settings.limits, tree, targetOf(settings, tree),
                            settings.R_lps_model, settings.law};
  if (settings.depth_first) {
    // What the gate would refuse of the task alone is refused all the same.
    ResolveDepthTaskSettings depth = *settings.depth_first;
    depth.max_std_mm = std::min(depth.max_std_mm, settings.supervisor.max_target_std_mm);
    return makeDepthFirst(depth, settings.task, context);
  }
  return makeTask(settings.task, context);
}

}  // namespace

Eigen::Vector3d targetOf(const ServoLoopSettings& settings, const VesselTree& tree) {
  if (!settings.target_model) return tree.centroid();
  const Eigen::Vector3d& target = *settings.target_model;
  const double beside_m = (tree.points().col(nearestPoint(tree, target)) - target).norm();
  if (!(beside_m <= kMaxBesideTree_m)) {
    throw InputError("servo loop", "target", formatted("%.1f mm from the nearest vessel", 1e3 * beside_m),
                     formatted("must be within %g mm of the tree", 1e3 * kMaxBesideTree_m));
  }
  return target;
}

PerceptionSettings ServoLoopSettings::perceptionForTask() const {
  PerceptionSettings settings = perception;
  settings.tracker.follow_motion |= patientMoves(task) || depth_first.has_value();
  return settings;
}

GatedPerceptionSettings ServoLoopSettings::gatedPerception() const {
  return {perceptionForTask(),
          supervisor,
          carm,
          T_dsa_cb,
          target_model,
          depth_first ? TargetNeed::kResolvingDepth : targetNeed(task)};
}

ExternalInputs ServoLoopSettings::externalInputs() const {
  const auto* center = std::get_if<CenterTaskSettings>(&task);
  return {external_registration, center != nullptr && center->on == CenterOn::kCatheterTip};
}

ServoLoop::ServoLoop(const ServoLoopSettings& settings, const VesselTree& tree)
    : settings_(checked(settings)),
      target_(targetOf(settings, tree)),
      task_(taskOf(settings, tree)),
      perception_(settings.gatedPerception(), tree, task_->place()),
      limiter_(settings.limits, 1e-6 * static_cast<double>(settings.supervisor.commandValidity_us())) {}

ServoReport ServoLoop::propose(const XrayFrame& frame, const ServoInput& input, const ExternalEstimates& external) {
  const double period_s = periodUntil(frame);
  ServoReport report;
  report.command = numbered(frame);
  answer(frame, input, external, period_s, report);
  report.view = task_->progress();
  if (report.hold_reason) limiter_.pass(period_s);
  return report;
}

ServoReport ServoLoop::step(const XrayFrame& frame, const CArmState& state, const ExternalEstimates& external) {
  ServoReport report = propose(frame, {frame.time_us, frame.sequence, state}, external);
  commit(report.command);
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

// No period is taken from the frame's time, which may be what is wrong with it.
ServoReport ServoLoop::refuse(const XrayFrame& frame, const std::string& why) {
  ServoReport report;
  report.hold_reason = why;
  report.command = numbered(frame);
  report.view = task_->progress();
  task_->interrupt();
  return report;
}

void ServoLoop::commit(const CArmCommand& sent) {
  limiter_.commit(sent.velocity);
  last_command_ = sent;
}

void ServoLoop::withhold(ServoReport& proposal, const std::string& why) {
  proposal.command = atRest(proposal.command);
  proposal.task = {};
  proposal.hold_reason = why;
}

void ServoLoop::learn() {
  perception_.learn();
  task_->learn();
}

// Stands still, and says which frame it answers.
CArmCommand ServoLoop::numbered(const XrayFrame& frame) const {
  CArmCommand command;
  command.time_us = frame.time_us;
  command.frame_sequence = frame.sequence;
  command.sequence = last_command_.sequence + 1;
  command.valid_for_us = settings_.supervisor.commandValidity_us();
  return command;
}

std::optional<std::string> ServoLoop::rejection(const ExternalEstimates& external) const {
  if (!settings_.external_registration) return std::nullopt;
  if (!external.registration) return "nobody has registered the frame";
  const bool converged = external.registration->status == static_cast<std::int8_t>(RegistrationStatus::kConverged);
  if (converged && external.registration->model_id != perception_.modelId()) {
    return "what was registered is another vessel tree";
  }
  return std::nullopt;
}

std::optional<std::string> ServoLoop::tipRejection(const ExternalEstimates& external) const {
  const auto& tip = external.tip;
  if (!tip) return "the catheter's tip is not located";
  if (tip->status != CatheterTipStatus::kLocated) return "the catheter's tip is not located: " + tip->reason;
  if (tip->model_id != perception_.modelId()) return "the catheter's tip was located in another vessel tree";
  return std::nullopt;
}

// Why the frame need not, or must not, be observed.
std::optional<std::string> ServoLoop::rejection(const XrayFrame& frame, const ServoInput& input,
                                                const ExternalEstimates& external) {
  if (auto why = perception_.rejection(frame, input.state)) return why;
  if (auto why = rejection(external)) return why;
  if (input.view.time_us != 0 && input.view.model_id != perception_.modelId()) {
    return "the view is asked for in another vessel tree";
  }
  return task_->waits(input.view);
}

void ServoLoop::answer(const XrayFrame& frame, const ServoInput& input, const ExternalEstimates& external,
                       double period_s, ServoReport& report) {
  const CArmState& state = input.state;
  report.hold_reason = rejection(frame, input, external);
  if (!report.hold_reason) {
    GatedObservation gated = settings_.external_registration
                                 ? perception_.adopt(registrationResult(*external.registration), state)
                                 : perception_.observe(frame, state);
    report.observed = true;
    report.observation = std::move(gated.observation);
    report.contradicts = gated.contradicts();
    report.hold_reason = std::move(gated.rejection);
    report.patient = gated.patient;
  }
  if (report.hold_reason) {
    task_->interrupt();
    return;
  }
  const Stopwatch control;
  const auto wanted = wantedVelocity(frame, state, external, std::min(period_s, kMaxPeriod_s), report);
  if (!wanted) return;
  report.command.velocity =
      limiter_.propose(*wanted, state.joints, ageAtArrival_s(frame.time_us, state, settings_.latency_s), period_s);
  report.control_s = control.seconds();
}

// What the task asks for; nothing where it holds, which the report then says.
std::optional<CArmJoints> ServoLoop::wantedVelocity(const XrayFrame& frame, const CArmState& state,
                                                    const ExternalEstimates& external, double period_s,
                                                    ServoReport& report) {
  TaskInput input{frame.time_us,
                  frame.camera,
                  report.patient->T_camera_model,
                  report.patient->covariance,
                  perception_.tracked_T_camera_model(state.joints),
                  state,
                  last_command_.velocity,
                  period_s,
                  settings_.latency_s};
  input.place = report.observation.place;
  input.points = report.patient->points;
  input.places = report.patient->places;
  if (perception_.resolved()) input.depth = &*perception_.resolved();
  if (task_->followsTip()) {
    report.hold_reason = tipRejection(external);
    if (report.hold_reason) {
      task_->interrupt();
      return std::nullopt;
    }
    input.target_model = external.tip->tip_model;
    input.target_covariance = external.tip->covariance;
  }
  const TaskAnswer answer = task_->answer(input);
  if (!answer.velocity) {
    report.hold_reason = answer.hold_reason.value_or("the task asks for no motion");
    report.contradicts = true;  // A sound observation that the task cannot act on.
    return std::nullopt;
  }
  report.task = answer;
  return answer.velocity;
}

OpenLoop::OpenLoop(const ServoLoopSettings& settings, const VesselTree& tree)
    : settings_(checked(settings)),
      task_(taskOf(settings, tree)),
      limiter_(settings.limits, 1e-6 * static_cast<double>(settings.supervisor.commandValidity_us())) {}

CArmCommand OpenLoop::step(const CArmState& state, double period_s) {
  CArmCommand command;
  command.time_us = state.time_us;
  command.sequence = last_command_.sequence + 1;
  command.valid_for_us = settings_.supervisor.commandValidity_us();
  const Pose calibrated = settings_.carm.T_camera_patient(state.joints) * settings_.T_dsa_cb;
  const TaskInput input{state.time_us, settings_.carm.camera(), calibrated, Matrix6d::Zero(),   calibrated,
                        state,         last_command_.velocity,  period_s,   settings_.latency_s};
  const TaskAnswer answer = task_->answer(input);
  hold_reason_ =
      answer.velocity ? std::nullopt : std::optional(answer.hold_reason.value_or("the task asks for no motion"));
  command.velocity = answer.velocity ? limiter_.limit(*answer.velocity, state.joints, settings_.latency_s, period_s)
                                     : limiter_.rest(period_s);
  last_command_ = command;
  return command;
}

}  // namespace angio::servo
