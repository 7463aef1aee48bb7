// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/tasks.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "angio/base/formatted.hpp"
#include "angio/motion/motion_predictor.hpp"
#include "joint_trajectory_mpc.hpp"
#include "latency_compensator.hpp"

namespace angio::servo {
namespace {

using Matrix23d = Eigen::Matrix<double, 2, 3>;

// A point with the covariance of its error.
struct SeenPoint {
  Eigen::Vector3d position;
  Eigen::Matrix3d covariance;
};

// Of the two directions across the beam, what of the table's three moves the image hardly at all.
constexpr double kMinShare = 0.05;
// Squared, in standard deviations: 99 % of two numbers are nearer.
constexpr double kContradicts = 9.21;

class CenterTask final : public Task {
 public:
  CenterTask(const CenterTaskSettings& settings, const TaskContext& context)
      : settings_(settings),
        carm_(context.carm),
        limits_(context.limits),
        target_(context.target_model),
        predictor_(settings.motion),
        in_flight_(context.limits) {}

  std::optional<PointOfInterest> place() const override {
    if (followsTip()) return std::nullopt;
    return PointOfInterest{target_, 1e-3 * settings_.near_mm, 1e-3 * settings_.near_std_mm};
  }

  bool followsTip() const override { return settings_.on == CenterOn::kCatheterTip; }

  TaskAnswer answer(const TaskInput& input) override;

  void interrupt() override { in_flight_.interrupt(); }  // The predictor knows the time, and may miss frames.

  void learn() override { predictor_.learn(); }

  std::optional<Pose> desired_T_camera_model() const override { return std::nullopt; }

 private:
  SeenPoint seen(const TaskInput& input) const;
  std::optional<std::string> contradiction(const TaskInput& input, double depth) const;
  std::optional<MotionPrediction> expected(double time_s) const;
  std::optional<CArmJoints> velocity(const CArmState& then, const Matrix23d& across, double arrival_s,
                                     double period_s) const;

  CenterTaskSettings settings_;
  CArmGeometry carm_;
  CArmLimits limits_;
  Eigen::Vector3d target_;
  MotionPredictor predictor_;
  LatencyCompensator in_flight_;
  std::optional<std::int64_t> first_us_;
};

// The target in the camera frame: by the registration, and across the beam by what is seen around it.
SeenPoint CenterTask::seen(const TaskInput& input) const {
  const Eigen::Vector3d target = input.target_model.value_or(target_);
  // The place that is watched is that of the task's own target.
  const PointObservation* place = input.place && !input.target_model ? &*input.place : nullptr;
  const Pose& T = place ? place->T_camera_model : input.T_camera_model;
  SeenPoint point;
  point.position = T * target;
  point.covariance = PatientObservation{T, input.covariance}.pointCovariance(target) +
                     T.linear() * input.target_covariance * T.linear().transpose();
  // A deformation that stretches the tree's image passes for a nearer tree, of which the rigid one's covariance knows
  // nothing.
  Eigen::Vector3d ray = point.position / point.position.z();
  const double depth_std_m = 1e-3 * settings_.depth_std_mm;
  point.covariance += depth_std_m * depth_std_m * ray * ray.transpose();
  if (!place || !place->image_shift) return point;
  const ImageShift& local = *place->image_shift;
  const double depth = point.position.z();
  const Eigen::Vector2d m_per_px(depth / input.camera.parameters().fx_px, depth / input.camera.parameters().fy_px);
  point.position.head<2>() += m_per_px.cwiseProduct(local.shift_px);
  // Depth by the registration, along the ray; the rest by the image.
  ray = point.position / depth;
  const double depth_variance = point.covariance(2, 2);
  point.covariance = depth_variance * ray * ray.transpose();
  point.covariance.topLeftCorner<2, 2>() += m_per_px.asDiagonal() * local.covariance_px * m_per_px.asDiagonal();
  return point;
}

// What is seen around the target where that is not believed, the registration explaining the image better, and would
// tell whether the target is centred.
std::optional<std::string> CenterTask::contradiction(const TaskInput& input, double depth) const {
  if (!input.place || !input.place->image_shift || input.target_model) return std::nullopt;
  const ImageShift& local = *input.place->image_shift;
  const double off_mm = 1e3 * depth / input.camera.parameters().fx_px * local.seen_px.norm();
  const bool sure = local.seen_px.dot(local.seen_covariance_px.inverse() * local.seen_px) > kContradicts;
  if (!(local.probability < 0.5 && sure && off_mm > settings_.reached_mm)) return std::nullopt;
  return formatted(
      "the image around the target shows it %.1f mm off the registration, with a probability of %.2g: not used", off_mm,
      local.probability);
}

std::optional<MotionPrediction> CenterTask::expected(double time_s) const {
  return settings_.predict ? predictor_.predict(time_s) : predictor_.predict(time_s, MotionModel::kHeld);
}

// The table's velocities with which the target's image goes to the wanted ray and stays there, as well as they can.
std::optional<CArmJoints> CenterTask::velocity(const CArmState& then, const Matrix23d& across, double arrival_s,
                                               double period_s) const {
  const Pose T_camera_patient = carm_.T_camera_patient(then.joints);
  const Matrix23d by_patient = across * T_camera_patient.linear();
  const Matrix23d by_table = -across * carm_.eJe(then.joints).block<3, 3>(0, 2);
  const Eigen::Vector2d singular = by_table.jacobiSvd().singularValues();
  if (!(singular[1] > kMinShare * singular[0])) return std::nullopt;
  const Eigen::Matrix<double, 3, 2> inverse = by_table.transpose() * (by_table * by_table.transpose()).inverse();
  JointPaths paths;
  for (int k = 1; k <= settings_.plan.periods_ahead; ++k) {
    const auto point = expected(arrival_s + k * period_s);
    if (!point || (point->beyond_horizon && k > 1)) break;
    CArmJoints places = CArmJoints::Zero();
    places.tail<3>() = -inverse * (across * (T_camera_patient * point->position));
    // What is less sure matters less.
    const double variance = 0.5 * (by_patient * point->covariance * by_patient.transpose()).trace();
    paths.add(places, 1 / (1 + variance / (kSure_m * kSure_m)));
  }
  CArmJoints result =
      followingVelocity(paths, {then.velocity, in_flight_.lastChange()}, limits_, settings_.plan, period_s);
  result.head<2>().setZero();  // By the table alone: angles that still turn come to rest.
  if (!result.allFinite()) return std::nullopt;
  return result;
}

TaskAnswer CenterTask::answer(const TaskInput& input) {
  TaskAnswer answer;
  const auto hold = [&](const std::string& why) {
    answer.velocity.reset();
    answer.hold_reason = why;
    in_flight_.interrupt();
    return answer;
  };
  if (!first_us_) first_us_ = input.time_us;
  const double time_s = 1e-6 * (static_cast<double>(input.time_us) - static_cast<double>(*first_us_));
  const CArmState then = in_flight_.atArrival(input);

  if (followsTip() && !input.target_model) return hold("where the catheter's tip is, is not known");
  const SeenPoint point = seen(input);
  const auto pixel = input.camera.project(point.position);
  if (!pixel) return hold("the target is not in front of the source");
  const XrayCamera::Parameters& k = input.camera.parameters();
  const Eigen::Vector2d wanted_px =
      Eigen::Vector2d(k.cx_px, k.cy_px) + Eigen::Map<const Eigen::Vector2d>(settings_.offset_px);
  answer.pixel_error = *pixel - wanted_px;

  const Pose T_patient_camera = carm_.T_camera_patient(input.state.joints).inverse();
  const Eigen::Matrix3d R = T_patient_camera.linear();
  const MotionUpdate update =
      predictor_.update(time_s, T_patient_camera * point.position, R * point.covariance * R.transpose());
  if (update.status == MotionStatus::kRefused) return hold(update.reason);
  const double arrival_s = time_s + input.latency_s;
  const auto at_arrival = expected(arrival_s);
  if (!at_arrival || !(input.period_s > 0)) return hold("the target's motion is not known");

  // How far the target is from the wanted ray, across the beam and at its own depth: what the table has to mend.
  const Eigen::Vector3d ray = input.camera.ray(wanted_px);
  Matrix23d across;
  across << 1, 0, -ray.x(), 0, 1, -ray.y();
  const Matrix23d by_patient = across * carm_.T_camera_patient(then.joints).linear();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> spread(by_patient * at_arrival->covariance *
                                                              by_patient.transpose());
  const double std_mm = 1e3 * std::sqrt(std::max(0.0, spread.eigenvalues()[1]));
  if (!(std_mm <= settings_.max_std_mm)) return hold("the target's motion is too unsure");

  const auto wanted = velocity(then, across, arrival_s, input.period_s);
  if (!wanted) return hold("the table does not move the image");
  answer.velocity = wanted;
  answer.target_off_m = (across * point.position).norm();
  answer.remark = contradiction(input, point.position.z());
  answer.reached = *answer.target_off_m <= 1e-3 * settings_.reached_mm;
  return answer;
}

}  // namespace

std::unique_ptr<Task> make(const CenterTaskSettings& settings, const TaskContext& context) {
  return std::make_unique<CenterTask>(settings, context);
}

}  // namespace angio::servo
