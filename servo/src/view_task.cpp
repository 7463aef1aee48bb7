// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/tasks.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/geometry/visp.hpp"
#include "latency_compensator.hpp"
#include "trajectory_bounds.hpp"

namespace angio::servo {
namespace {

// A machine that was told to stand still for longer starts a new trajectory.
constexpr std::int64_t kShortHold_us = 1'000'000;
// Back inside is where an excursion is less than so much of its bound.
constexpr double kBackInside = 0.9;
constexpr int kMaxAveraged = 15;  // Frames that a mean which forgets over eight is worth.

// A view as the task works with it.
struct Goal {
  Pose T_camera_model;
  Eigen::Vector3d target_model;  // At the isocentre's distance on the beam.
};

Goal goalOf(const DesiredView& view, double source_isocenter_distance_m) {
  return {desiredPose(view, source_isocenter_distance_m), view.target_model};
}

Goal bestViewGoal(const ViewTaskSettings& settings, const TaskContext& context) {
  const TreeSegment segment = settings.segment_first < 0 && settings.segment_last < 0
                                  ? segmentOfBranch(context.tree, settings.branch)
                                  : segmentBetween(context.tree, settings.segment_first, settings.segment_last);
  const BestViewScene scene = bestViewScene(context.carm, context.limits, context.R_lps_model);
  const BestView best = bestView(context.tree, segment, scene, settings.best_view);
  return goalOf({best.angles, best.target_model, context.R_lps_model}, scene.source_isocenter_distance_m);
}

Goal poseGoal(const Pose& T, double source_isocenter_distance_m) {
  if (!T.matrix().allFinite() || !(rotationDefect(T.linear()) < 1e-6)) {
    throw InputError(ViewTaskSettings::kName, "T_camera_model", "", "must be a pose");
  }
  return {T, T.inverse() * Eigen::Vector3d(0, 0, source_isocenter_distance_m)};
}

Goal goalOf(const ViewTaskSettings& settings, const TaskContext& context) {
  const double distance_m = context.carm.source_isocenter_distance_m;
  switch (settings.goal) {
    case ViewGoal::kBestView:
      return bestViewGoal(settings, context);
    case ViewGoal::kPose:
      return poseGoal(settings.T_camera_model, distance_m);
    case ViewGoal::kAngles:
    case ViewGoal::kRequested:  // Not used before the first request.
      break;
  }
  const ViewAngles angles{degToRad(settings.primary_deg), degToRad(settings.secondary_deg)};
  return goalOf({angles, context.target_model, context.R_lps_model}, distance_m);
}

// Joints at which an arm comes to rest that brakes as hard as it can.
CArmJoints restOf(const CArmState& state, const CArmLimits& limits) {
  const Eigen::Array<double, kCArmJointCount, 1> v = state.velocity.array();
  return (state.joints.array() + 0.5 * v * v.abs() / limits.acceleration.array()).matrix();
}

class ViewTask final : public Task {
 public:
  ViewTask(const ViewTaskSettings& settings, const TaskContext& context)
      : settings_(settings),
        carm_(context.carm),
        limits_(context.limits),
        goal_(goalOf(settings, context)),
        law_(makeServoLaw(context.law, {&context.tree, goal_.target_model})),
        in_flight_(context.limits) {
    if (settings.goal == ViewGoal::kRequested) requested_.emplace(context);
  }

  std::optional<std::string> waits(const ViewRequest& request) override;

  ViewProgress progress() const override { return requested_ ? requested_->progress : ViewProgress{}; }

  TaskAnswer answer(const TaskInput& input) override;

  void interrupt() override {
    in_flight_.interrupt();
    frames_inside_ = 0;
  }

  std::optional<Pose> desired_T_camera_model() const override {
    if (requested_ && requested_->progress.request_us == 0) return std::nullopt;
    return goal_.T_camera_model;
  }

 private:
  bool staysInside(const ViewError& error, const TaskInput& input);
  void followTrajectory(const TaskInput& input, const CArmJoints& rest, bool reached);
  std::optional<std::string> brokenBound(const CArmJoints& rest, const CArmJoints& end, const Pose& T_patient_model);
  CArmJoints brakable(CArmJoints velocity, const CArmJoints& left, double period_s) const;

  ViewTaskSettings settings_;
  CArmGeometry carm_;
  CArmLimits limits_;
  Goal goal_;
  std::unique_ptr<ServoLaw> law_;
  LatencyCompensator in_flight_;
  int frames_inside_ = 0;

  std::optional<TrajectoryStart> trajectory_start_;  // To the present goal.
  std::optional<std::int64_t> sent_us_;              // When motion was commanded last.
  bool table_broken_ = false, target_broken_ = false;

  // Of views that are asked for.
  struct Requested {
    explicit Requested(const TaskContext& context)
        : tree(context.tree), R_lps_model(context.R_lps_model), law(context.law) {}
    VesselTree tree;
    Eigen::Matrix3d R_lps_model;
    ServoLawSettings law;
    ViewProgress progress;
  };
  std::optional<Requested> requested_;
};

std::optional<std::string> ViewTask::waits(const ViewRequest& request) {
  if (!requested_) return std::nullopt;
  ViewProgress& progress = requested_->progress;
  if (request.time_us == 0) return "no view has been asked for";
  if (request.time_us != progress.request_us) {
    progress = {request.time_us, false};
    const ViewAngles angles = viewAnglesOf(Eigen::Vector3d(requested_->R_lps_model * request.beam_model));
    goal_ = goalOf({angles, request.target_model, requested_->R_lps_model}, carm_.source_isocenter_distance_m);
    law_ = makeServoLaw(requested_->law, {&requested_->tree, goal_.target_model});
    settings_.reached_deg = radToDeg(request.within_rad);
    settings_.reached_mm = 1e3 * request.within_m;
    frames_inside_ = 0;
    trajectory_start_.reset();
    table_broken_ = target_broken_ = false;
  }
  if (progress.reached) return "the view that was asked for is reached";
  return std::nullopt;
}

TaskAnswer ViewTask::answer(const TaskInput& input) {
  // The patient lies still, so the average of many frames is the better observation.
  const Pose seen = input.trackedPoseAt(goal_.target_model);
  TaskAnswer answer;
  answer.view_error = viewError(seen, goal_.T_camera_model, goal_.target_model);
  answer.reached = staysInside(*answer.view_error, input);
  if (requested_ && answer.reached) requested_->progress.reached = true;
  // The law answers to where the arm will be when its command arrives.
  const CArmState arrival = in_flight_.atArrival(input);
  const CArmJoints& then = arrival.joints;
  const CArmJoints rest = restOf(arrival, limits_);
  const Pose T_patient_model = carm_.T_camera_patient(input.state.joints).inverse() * seen;
  followTrajectory(input, rest, answer.reached);
  const Pose cMo = carm_.T_camera_patient(then) * T_patient_model;
  const Eigen::Vector3d beam_model = goal_.T_camera_model.linear().row(2);
  const auto end = carm_.reachable(viewAnglesOf(Eigen::Vector3d(T_patient_model.linear() * beam_model)),
                                   T_patient_model * goal_.target_model, limits_, then);
  if (!end) {
    answer.hold_reason = "the view is out of the arm's reach";
    return answer;
  }
  answer.hold_reason = brokenBound(rest, *end, T_patient_model);
  if (answer.hold_reason) return answer;
  const CArmJoints left = *end - then;
  const auto wanted =
      law_->velocity({toVisp(cMo), toVisp(goal_.T_camera_model), toVisp(carm_.eJe(then)), &input.camera, left});
  if (!wanted) {
    answer.hold_reason = "the control law is singular";
    return answer;
  }
  answer.velocity = brakable(*wanted, left, input.period_s);
  return answer;
}

// A trajectory starts where the machine is while no motion is commanded, because none is proposed or because proposals
// are taken back. A short hold or a broken bound does not end it. A view that is reached ends it; the next motion is
// another one.
void ViewTask::followTrajectory(const TaskInput& input, const CArmJoints& rest, bool reached) {
  if (!input.last_velocity.isZero(0)) sent_us_ = input.time_us;
  const bool goes_on = table_broken_ || target_broken_ || (sent_us_ && input.time_us - *sent_us_ <= kShortHold_us);
  if (trajectory_start_ && goes_on && !reached) return;
  trajectory_start_ = TrajectoryStart{input.state.joints, rest};
}

// Where the arm would come to rest if it were told to stand still now: what it does until then no hold could mend.
std::optional<std::string> ViewTask::brokenBound(const CArmJoints& rest, const CArmJoints& end,
                                                 const Pose& T_patient_model) {
  const Eigen::Vector3d target = T_patient_model * goal_.target_model, goal = goal_.T_camera_model * goal_.target_model;
  const TrajectoryExcursion off = trajectory_start_->excursion(
      rest, end, [&](const CArmJoints& q) { return (carm_.T_camera_patient(q) * target - goal).norm(); });
  const auto broken = [](bool& was, double off_mm, double max_mm) {
    return was = max_mm > 0 && off_mm > (was ? kBackInside : 1) * max_mm;
  };
  const char* kWhatToDo = "move the machine back, ask for another view, or raise view.";
  if (broken(table_broken_, 1e3 * off.table_m, settings_.max_table_excursion_mm)) {
    return formatted("the table comes to rest %.1f mm outside the box of start and goal, of %.1f mm allowed: %s%s",
                     1e3 * off.table_m, settings_.max_table_excursion_mm, kWhatToDo, "max_table_excursion_mm");
  }
  if (broken(target_broken_, 1e3 * off.target_m, settings_.max_target_excursion_mm)) {
    return formatted(
        "the target comes to rest %.1f mm further from its goal than at the start, of %.1f mm allowed: %s%s",
        1e3 * off.target_m, settings_.max_target_excursion_mm, kWhatToDo, "max_target_excursion_mm");
  }
  return std::nullopt;
}

// No joint comes in faster than it can brake. Each by itself: one that is there already must not stop the others.
CArmJoints ViewTask::brakable(CArmJoints velocity, const CArmJoints& left, double period_s) const {
  for (int i = 0; i < kCArmJointCount; ++i) {
    if (!(velocity[i] * left[i] > 0)) continue;
    // v delay + v^2 / 2a = left: half the time that the acceleration takes to come, and a frame.
    const double a = settings_.braking_share * limits_.acceleration[i];
    const double delay_s = 0.5 * a / limits_.jerk[i] + period_s;
    const double most = std::sqrt(a * a * delay_s * delay_s + 2 * a * std::abs(left[i])) - a * delay_s;
    velocity[i] = std::clamp(velocity[i], -most, most);
  }
  return velocity;
}

bool ViewTask::staysInside(const ViewError& error, const TaskInput& input) {
  const double place_variance = std::pow(input.patient().worstStd_m(goal_.target_model), 2);
  const double direction_variance = input.covariance(3, 3) + input.covariance(4, 4);
  // What a turn has told is the same in every frame.
  const double averaged = input.places ? 1 : std::min(frames_inside_ + 1, kMaxAveraged);
  const auto within = [&](double size, double variance, double most) {
    return size + std::sqrt(std::max(0.0, variance) / averaged) <= most;
  };
  const double max_rad = degToRad(settings_.reached_deg), max_m = 1e-3 * settings_.reached_mm;
  const bool inside = error.direction_rad <= max_rad && error.target_m <= max_m;
  frames_inside_ = inside ? frames_inside_ + 1 : 0;
  return frames_inside_ >= settings_.reached_frames && within(error.direction_rad, direction_variance, max_rad) &&
         within(error.target_m, place_variance, max_m);
}

}  // namespace

std::unique_ptr<Task> make(const ViewTaskSettings& settings, const TaskContext& context) {
  return std::make_unique<ViewTask>(settings, context);
}

}  // namespace angio::servo
