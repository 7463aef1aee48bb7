// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/tasks.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "latency_compensator.hpp"

namespace angio::servo {
namespace {

// The arm is where it should be when it is as near as this.
constexpr double kThere_rad = 1e-3;
// It comes in by this share of its distance a second, and brakes with this share of its acceleration.
constexpr double kGain_per_s = 4, kBrakingShare = 0.5;
// The frames of a turn are asked together when it is over, in the time of a few of them.
constexpr int kFramesToAnswer = 15;

// By the frame, and by what a turn has told.
double targetStd_mm(const TaskInput& input, const Eigen::Vector3d& target_model) {
  return 1e3 * PatientObservation{input.T_camera_model, input.covariance, input.points, input.places}.worstStd_m(
                   target_model);
}

class ResolveDepthTask final : public Task {
 public:
  ResolveDepthTask(const ResolveDepthTaskSettings& settings, const CArmLimits& limits,
                   const Eigen::Vector3d& target_model)
      : settings_(settings), limits_(limits), target_(target_model), in_flight_(limits) {}

  TaskAnswer answer(const TaskInput& input) override;

  void interrupt() override { in_flight_.interrupt(); }

  std::optional<Pose> desired_T_camera_model() const override { return std::nullopt; }

 private:
  void begin(const TaskInput& input);
  double velocity(const CArmState& then) const;

  ResolveDepthTaskSettings settings_;
  CArmLimits limits_;
  Eigen::Vector3d target_;
  LatencyCompensator in_flight_;
  std::optional<std::int64_t> first_us_;  // Of the first frame that left the depth open.
  std::optional<double> from_rad_, to_rad_;
  int frames_ = 0, frames_there_ = 0;
};

// To the side where the primary angle has more room, by as much as there is.
void ResolveDepthTask::begin(const TaskInput& input) {
  from_rad_ = input.state.joints[0];
  const double up_rad = limits_.upper[0] - *from_rad_, down_rad = *from_rad_ - limits_.lower[0];
  const double turn_rad = std::min(degToRad(settings_.max_turn_deg), std::max({up_rad, down_rad, 0.0}));
  to_rad_ = *from_rad_ + (up_rad >= down_rad ? turn_rad : -turn_rad);
}

double ResolveDepthTask::velocity(const CArmState& then) const {
  const double left_rad = *to_rad_ - then.joints[0];
  const double braking = std::sqrt(2 * kBrakingShare * limits_.acceleration[0] * std::abs(left_rad));
  const double most = std::min({degToRad(settings_.speed_deg_per_s), braking, kGain_per_s * std::abs(left_rad)});
  return std::copysign(most, left_rad);
}

TaskAnswer ResolveDepthTask::answer(const TaskInput& input) {
  TaskAnswer answer;
  answer.velocity = CArmJoints::Zero();
  const CArmState then = in_flight_.atArrival(input);
  if (!from_rad_ || frames_there_ == 0) ++frames_;  // What was needed: not what comes after it.
  if (!first_us_) {
    const double std_mm = targetStd_mm(input, target_);
    if (std_mm <= settings_.max_std_mm) {
      answer.reached = true;
      answer.remark = formatted("one view knows the target to %.1f mm, of %.1f mm asked", std_mm, settings_.max_std_mm);
      return answer;
    }
    first_us_ = input.time_us;
  }
  const double watched_s = 1e-6 * (static_cast<double>(input.time_us) - static_cast<double>(*first_us_));
  if (watched_s < settings_.watch_s) {
    answer.remark = formatted("the target's depth is open: watching how the patient moves, %.1f of %.1f s", watched_s,
                              settings_.watch_s);
    return answer;
  }
  if (!from_rad_) begin(input);
  const bool there = std::abs(*to_rad_ - then.joints[0]) < kThere_rad;
  if (!there && frames_there_ == 0) {
    (*answer.velocity)[0] = velocity(then);
    answer.remark =
        formatted("the target's depth is open: turned by %.1f of %.1f deg",
                  radToDeg(std::abs(input.state.joints[0] - *from_rad_)), radToDeg(std::abs(*to_rad_ - *from_rad_)));
    return answer;
  }
  ++frames_there_;
  // What was found before this turn had ended is not by all of it.
  const bool known = input.depth && input.depth->fit.turn_rad > 0.5 * std::abs(*to_rad_ - *from_rad_);
  if (!known && frames_there_ < kFramesToAnswer) {
    answer.remark = std::string("the target's depth is open: the turn is over, its frames are asked together");
    return answer;
  }
  const double turned_deg = radToDeg(std::abs(*to_rad_ - *from_rad_));
  const auto hold = [&](const std::string& why) {
    answer.velocity.reset();
    answer.hold_reason = why + ": look from elsewhere";
    return answer;
  };
  const std::string silent = formatted("the frames of a turn by %.1f deg do not tell the target's depth", turned_deg);
  if (!known) return hold(silent);
  const RegistrationResult& together = input.depth->fit.registration;
  if (together.status != RegistrationStatus::kConverged) return hold(silent + ", " + together.reason);
  const double std_mm = 1e3 * input.depth->worstStd_m();
  const std::string found = formatted(
      "the target is %.1f mm from the source, known to %.1f mm, of %.1f mm asked, by a "
      "turn of %.1f deg and %d frames",
      1e3 * input.depth->target_camera.z(), std_mm, settings_.max_std_mm, turned_deg, frames_);
  if (!(std_mm <= settings_.max_std_mm)) return hold(found);
  answer.reached = true;
  answer.remark = found;
  return answer;
}

class DepthFirst final : public Task {
 public:
  DepthFirst(const ResolveDepthTaskSettings& settings, const TaskContext& context, std::unique_ptr<Task> task)
      : settings_(settings), limits_(context.limits), target_(context.target_model), task_(std::move(task)) {}

  std::optional<PointOfInterest> place() const override { return task_->place(); }
  bool followsTip() const override { return task_->followsTip(); }
  std::optional<std::string> waits(const ViewRequest& request) override { return task_->waits(request); }
  ViewProgress progress() const override { return task_->progress(); }
  TaskAnswer answer(const TaskInput& input) override;
  void interrupt() override {
    task_->interrupt();
    if (resolving_) resolving_->interrupt();
  }
  void learn() override { task_->learn(); }
  std::optional<Pose> desired_T_camera_model() const override { return task_->desired_T_camera_model(); }

 private:
  ResolveDepthTaskSettings settings_;
  CArmLimits limits_;
  Eigen::Vector3d target_;
  std::unique_ptr<Task> task_;
  std::unique_ptr<ResolveDepthTask> resolving_;  // While the depth is open.
};

TaskAnswer DepthFirst::answer(const TaskInput& input) {
  const double std_mm = targetStd_mm(input, target_);
  if (std_mm <= settings_.max_std_mm) {
    resolving_.reset();
    return task_->answer(input);
  }
  // A turn has told the depth, at another moment of the breath or not well enough.
  if (input.places) {
    resolving_.reset();
    task_->interrupt();
    TaskAnswer answer;
    answer.hold_reason = formatted(
        "after a turn of %.1f deg this frame knows the target to %.1f mm, of %.1f mm asked: wait for the breath, or "
        "look from elsewhere",
        input.depth ? radToDeg(input.depth->fit.turn_rad) : 0.0, std_mm, settings_.max_std_mm);
    return answer;
  }
  if (!resolving_) {
    task_->interrupt();
    resolving_ = std::make_unique<ResolveDepthTask>(settings_, limits_, target_);
  }
  TaskAnswer answer = resolving_->answer(input);
  // Its own end is not the other task's.
  answer.reached = false;
  return answer;
}

}  // namespace

std::unique_ptr<Task> make(const ResolveDepthTaskSettings& settings, const TaskContext& context) {
  return std::make_unique<ResolveDepthTask>(settings, context.limits, context.target_model);
}

std::unique_ptr<Task> makeDepthFirst(const ResolveDepthTaskSettings& settings, const TaskSettings& task,
                                     const TaskContext& context) {
  checkSettings(ResolveDepthTaskSettings::kName, settings);
  if (targetNeed(task) != TargetNeed::kEverywhere) {
    throw InputError(ResolveDepthTaskSettings::kName, "first", "true",
                     "is for hold, and for a view that is not asked for over the bus");
  }
  return std::make_unique<DepthFirst>(settings, context, makeTask(task, context));
}

}  // namespace angio::servo
