// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/tasks.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

#include "angio/motion/motion_predictor.hpp"
#include "joint_trajectory_mpc.hpp"
#include "latency_compensator.hpp"

namespace angio::servo {
namespace {

// A rotation is predicted as the motion of a point so far from its axis: the predictor's settings are lengths.
constexpr double kLever_m = 0.1;
// Below this the arm's two angles turn it about one axis.
constexpr double kMinReciprocalCondition = 1e-4;

double worstStd(const Eigen::Matrix3d& covariance) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues()[2]));
}

class HoldTask final : public Task {
 public:
  HoldTask(const HoldTaskSettings& settings, const TaskContext& context)
      : settings_(settings),
        carm_(context.carm),
        target_(context.target_model),
        limits_(context.limits),
        place_(settings.motion),
        rotation_(settings.motion),
        in_flight_(context.limits) {}

  TaskAnswer answer(const TaskInput& input) override;

  void interrupt() override { in_flight_.interrupt(); }  // The predictors know the time, and may miss frames.

  void learn() override {
    place_.learn();
    rotation_.learn();
  }

  std::optional<Pose> desired_T_camera_model() const override { return desired_; }

 private:
  // Where the model is in the patient frame at a time, as predicted.
  struct Expected {
    Pose T_patient_model;
    double place_std_m, rotation_std_rad;
    bool beyond_horizon;
  };
  std::optional<std::string> take(const TaskInput& input, double time_s);
  std::optional<Expected> expected(double time_s) const;
  class Keeping;

  HoldTaskSettings settings_;
  CArmGeometry carm_;
  Eigen::Vector3d target_;
  CArmLimits limits_;
  MotionPredictor place_, rotation_;
  LatencyCompensator in_flight_;
  std::optional<std::int64_t> first_us_;
  std::optional<Pose> desired_;
  Eigen::Matrix3d first_R_patient_model_ = Eigen::Matrix3d::Identity();
};

// Why the frame's registration could not be taken in.
std::optional<std::string> HoldTask::take(const TaskInput& input, double time_s) {
  const Pose T_patient_camera = carm_.T_camera_patient(input.state.joints).inverse();
  const Pose T_patient_model = T_patient_camera * input.patient().poseAt(target_);
  if (!desired_) {
    desired_ = input.trackedPoseAt(target_);
    first_R_patient_model_ = T_patient_model.linear();
  }
  const Eigen::Matrix3d R = T_patient_camera.linear();
  const MotionUpdate place =
      place_.update(time_s, T_patient_model * target_, input.patient().pointCovariance(target_, R));
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
  Expected result{Pose::Identity(), worstStd(place->covariance), worstStd(rotation->covariance) / kLever_m,
                  place->beyond_horizon || rotation->beyond_horizon};
  result.T_patient_model.linear() = expSO3(rotation->position / kLever_m) * first_R_patient_model_;
  result.T_patient_model.translation() = place->position - result.T_patient_model.linear() * target_;
  return result;
}

// The joints' motions, from `joints`, by which the target comes to its place in the camera and the beam to its
// direction when the patient is as expected: for small motions, which are all that a breath asks for.
class HoldTask::Keeping {
 public:
  Keeping(const CArmGeometry& carm, const CArmJoints& joints, const Pose& desired, const Eigen::Vector3d& target_model)
      : T_camera_patient_(carm.T_camera_patient(joints)), desired_(desired), target_(target_model) {
    const auto J = carm.eJe(joints);
    Eigen::Matrix<double, 5, 5> A;
    A.topRows<3>() = J.topRows<3>() - skew(desired_ * target_) * J.bottomRows<3>();
    A.bottomRows<2>() = J.middleRows<2>(3);
    solver_.compute(A);
  }

  bool possible() const { return solver_.rcond() > kMinReciprocalCondition; }

  CArmJoints motions(const Pose& T_patient_model) const {
    const Pose cMo = T_camera_patient_ * T_patient_model;
    Eigen::Matrix<double, 5, 1> b;
    b << cMo * target_ - desired_ * target_, logSO3(cMo.linear() * desired_.linear().transpose()).head<2>();
    return solver_.solve(b);
  }

 private:
  Pose T_camera_patient_, desired_;
  Eigen::Vector3d target_;
  Eigen::FullPivLU<Eigen::Matrix<double, 5, 5>> solver_;
};

TaskAnswer HoldTask::answer(const TaskInput& input) {
  TaskAnswer answer;
  const auto hold = [&](const std::string& why) {
    answer.hold_reason = why;
    in_flight_.interrupt();
    return answer;
  };
  if (!first_us_) first_us_ = input.time_us;
  const double time_s = 1e-6 * (static_cast<double>(input.time_us) - static_cast<double>(*first_us_));
  const CArmState then = in_flight_.atArrival(input);
  if (const auto why = take(input, time_s)) return hold(*why);
  answer.view_error = viewError(input.patient().poseAt(target_), *desired_, target_);

  const double arrival_s = time_s + input.latency_s;
  const auto at_arrival = expected(arrival_s);
  if (!at_arrival || !(input.period_s > 0)) return hold("the patient's motion is not known");
  if (!(1e3 * at_arrival->place_std_m <= settings_.max_std_mm) ||
      !(radToDeg(at_arrival->rotation_std_rad) <= settings_.max_std_deg)) {
    return hold("the patient's motion is too unsure");
  }
  const Keeping keeping(carm_, then.joints, *desired_, target_);
  if (!keeping.possible()) return hold("the arm's angles turn it about one axis");
  JointPaths paths;
  for (int k = 1; k <= settings_.plan.periods_ahead; ++k) {
    const auto then_expected = expected(arrival_s + k * input.period_s);
    if (!then_expected || (then_expected->beyond_horizon && k > 1)) break;
    const double unsure = then_expected->place_std_m / kSure_m;
    paths.add(keeping.motions(then_expected->T_patient_model), 1 / (1 + unsure * unsure));
  }
  const CArmJoints wanted =
      followingVelocity(paths, {then.velocity, in_flight_.lastChange()}, limits_, settings_.plan, input.period_s);
  if (!wanted.allFinite()) return hold("the patient's motion is not finite");
  answer.velocity = wanted;
  answer.reached = radToDeg(answer.view_error->direction_rad) <= settings_.reached_deg &&
                   1e3 * answer.view_error->target_m <= settings_.reached_mm;
  return answer;
}

}  // namespace

std::unique_ptr<Task> make(const HoldTaskSettings& settings, const TaskContext& context) {
  return std::make_unique<HoldTask>(settings, context);
}

}  // namespace angio::servo
