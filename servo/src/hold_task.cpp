// SPDX-License-Identifier: GPL-2.0-or-later
#include "hold_task.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

#include "angio/geometry/visp.hpp"
#include "angio/motion/motion_predictor.hpp"
#include "commands_in_flight.hpp"

namespace angio {
namespace {

// A rotation is predicted as the way of a point so far from its axis: the predictor's settings are lengths.
constexpr double kLever_m = 0.1;
// Below this the arm's two angles turn it about one axis.
constexpr double kLeastReciprocalCondition = 1e-4;

double worstStd(const Eigen::Matrix3d& covariance) {
  return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvalues()[2]));
}

class HoldTask final : public Task {
 public:
  HoldTask(const HoldTaskSettings& settings, const TaskContext& context)
      : settings_(settings),
        carm_(context.carm),
        target_(context.target_model),
        law_(makeServoLaw(context.law, {&context.tree, context.target_model})),
        place_(settings.motion),
        rotation_(settings.motion),
        in_flight_(context.limits) {}

  TaskAnswer answer(const TaskInput& input) override;

  void interrupt() override { in_flight_.interrupt(); }  // The predictors know the time, and may miss frames.

  std::optional<Pose> desired_T_camera_model() const override { return desired_; }

 private:
  // Where the model is in the patient frame at a time, as predicted.
  struct Expected {
    Pose T_patient_model;
    double place_std_m, rotation_std_rad;
  };
  std::optional<std::string> take(const TaskInput& input, double time_s);
  std::optional<Expected> expected(double time_s) const;
  std::optional<CArmJoints> along(const Pose& now, const Pose& then, double dt_s, const CArmJoints& joints) const;

  HoldTaskSettings settings_;
  CArmGeometry carm_;
  Eigen::Vector3d target_;
  std::unique_ptr<ServoLaw> law_;
  MotionPredictor place_, rotation_;
  CommandsInFlight in_flight_;
  std::optional<std::int64_t> first_us_;
  std::optional<Pose> desired_;
  Eigen::Matrix3d first_R_patient_model_ = Eigen::Matrix3d::Identity();
};

// Why the frame's registration could not be taken in.
std::optional<std::string> HoldTask::take(const TaskInput& input, double time_s) {
  const Pose T_patient_camera = carm_.T_camera_patient(input.state.joints).inverse();
  const Pose T_patient_model = T_patient_camera * input.T_camera_model;
  if (!desired_) {
    desired_ = input.T_camera_model_tracked;
    first_R_patient_model_ = T_patient_model.linear();
  }
  const Eigen::Matrix3d R = T_patient_camera.linear();
  Eigen::Matrix<double, 3, 6> J;
  J << R, -R * skew(input.T_camera_model.linear() * target_);
  const MotionUpdate place = place_.update(time_s, T_patient_model * target_, J * input.covariance * J.transpose());
  const Eigen::Matrix3d turned = R * input.covariance.bottomRightCorner<3, 3>() * R.transpose();
  const MotionUpdate rotation =
      rotation_.update(time_s, kLever_m * logSO3(T_patient_model.linear() * first_R_patient_model_.transpose()),
                       kLever_m * kLever_m * turned);
  for (const MotionUpdate& update : {place, rotation}) {
    if (update.status == MotionStatus::kRefused) return update.reason;
  }
  return std::nullopt;
}

std::optional<HoldTask::Expected> HoldTask::expected(double time_s) const {
  const auto at = [&](const MotionPredictor& predictor) {
    return settings_.predict ? predictor.predict(time_s) : predictor.predict(time_s, MotionModel::kHeld);
  };
  const auto place = at(place_), rotation = at(rotation_);
  if (!place || !rotation) return std::nullopt;
  Expected result{Pose::Identity(), worstStd(place->covariance), worstStd(rotation->covariance) / kLever_m};
  result.T_patient_model.linear() = expSO3(rotation->position / kLever_m) * first_R_patient_model_;
  result.T_patient_model.translation() = place->position - result.T_patient_model.linear() * target_;
  return result;
}

// Joint velocities with which the camera goes along with the model: the target keeps its place in the camera, and the
// beam its direction.
std::optional<CArmJoints> HoldTask::along(const Pose& now, const Pose& then, double dt_s,
                                          const CArmJoints& joints) const {
  const Pose T_camera_patient = carm_.T_camera_patient(joints);
  const Eigen::Vector3d target = T_camera_patient * (now * target_);
  const Eigen::Vector3d v = T_camera_patient.linear() * (then * target_ - now * target_) / dt_s;
  const Eigen::Vector3d w = T_camera_patient.linear() * logSO3(then.linear() * now.linear().transpose()) / dt_s;
  const auto J = carm_.eJe(joints);
  Eigen::Matrix<double, 5, 5> A;
  A.topRows<3>() = J.topRows<3>() - skew(target) * J.bottomRows<3>();
  A.bottomRows<2>() = J.middleRows<2>(3);
  Eigen::Matrix<double, 5, 1> b;
  b << v, w.head<2>();
  const Eigen::FullPivLU<Eigen::Matrix<double, 5, 5>> solver(A);
  if (!(solver.rcond() > kLeastReciprocalCondition)) return std::nullopt;
  return CArmJoints(solver.solve(b));
}

TaskAnswer HoldTask::answer(const TaskInput& input) {
  TaskAnswer answer;
  const auto hold = [&](const std::string& why) {
    answer.held = why;
    in_flight_.interrupt();
    return answer;
  };
  if (!first_us_) first_us_ = input.time_us;
  const double time_s = 1e-6 * (static_cast<double>(input.time_us) - static_cast<double>(*first_us_));
  const CArmState then = in_flight_.atArrival(input);
  if (const auto why = take(input, time_s)) return hold(*why);
  answer.view_error = viewError(input.T_camera_model, *desired_, target_);

  const double arrival_s = time_s + input.latency_s;
  const auto at_arrival = expected(arrival_s), at_end = expected(arrival_s + input.period_s);
  if (!at_arrival || !at_end || !(input.period_s > 0)) return hold("the patient's motion is not known");
  if (!(1e3 * at_arrival->place_std_m <= settings_.most_std_mm) ||
      !(radToDeg(at_arrival->rotation_std_rad) <= settings_.most_std_deg)) {
    return hold("the patient's motion is too unsure");
  }
  const Pose cMo = carm_.T_camera_patient(then.joints) * at_arrival->T_patient_model;
  const auto back = law_->velocity({toVisp(cMo), toVisp(*desired_), toVisp(carm_.eJe(then.joints)), &input.camera});
  const auto feed_forward = along(at_arrival->T_patient_model, at_end->T_patient_model, input.period_s, then.joints);
  if (!back || !feed_forward) return hold("the control law is singular");
  const CArmJoints wanted = *back + *feed_forward;
  if (!wanted.allFinite()) return hold("the control law is singular");
  answer.velocity = wanted;
  answer.reached = radToDeg(answer.view_error->direction_rad) <= settings_.reached_deg &&
                   1e3 * answer.view_error->target_m <= settings_.reached_mm;
  return answer;
}

}  // namespace

std::unique_ptr<Task> make(const HoldTaskSettings& settings, const TaskContext& context) {
  checkSettings(HoldTaskSettings::kName, settings);
  return std::make_unique<HoldTask>(settings, context);
}

}  // namespace angio
