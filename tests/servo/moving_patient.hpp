// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>

#include "angio/robot/carm_motion_limiter.hpp"
#include "angio/servo/tasks.hpp"
#include "angio/simulation/patient_motion.hpp"
#include "angio/simulation/simulated_carm.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {

/// A patient who breathes 15 mm deep, no two breaths alike, with a heartbeat of 2 mm and a drift, on the table of an
/// arm whose commands arrive 80 ms after the frames they answer. Registrations are the truth with noise: no images.
class MovingPatient {
 public:
  explicit MovingPatient(unsigned seed, double heart_mm = 2)
      : random_(seed), motion_(settings(heart_mm), target, Eigen::Matrix3d::Identity(), seed) {}

  static MotionSettings settings(double heart_mm) {
    MotionSettings s;
    s.breathing.amplitude_mm = 15;
    s.breathing.diaphragm_mm = 0;  // The target is where it moves most.
    s.breathing.drift_mm_per_min = 3;
    s.heartbeat.amplitude_mm = heart_mm;
    s.heartbeat.center_mm[2] = 50;
    return s;
  }

  struct Errors {
    double rms_mm = 0, worst_mm = 0;  ///< Of the target, across the beam, at its own depth.
    double beam_rms_deg = 0;          ///< Between the beam and what it was at first, seen from the model.
    int held = 0;                     ///< Frames.
    double max_share_of_limits = 0;   ///< Of the joints' speeds, as parts of what they may be.
  };

  /// Runs a task for some time; errors count from `from_s` on, every 5 ms.
  Errors run(Task& task, double duration_s, double from_s);

  const VesselTree tree = branchingTree(6);
  const Eigen::Vector3d target = tree.points().col(60);
  CArmGeometry carm;
  CArmLimits limits = CArmLimits::typical();
  double first_offset_m = 0.01;  ///< Of the target, sideways.
  double turn_deg = 0;           ///< Of the model with each 10 mm of displacement, about the patient's left.
  double latency_s = 0.08;
  double false_depth_m = 0;  ///< Of a third of the registrations, which do not know of it.
  double lateral_noise_m = 0.2e-3, depth_noise_m = 2e-3, turn_noise_rad = degToRad(0.1);

  TaskContext context() const {
    return {carm, limits, tree, target, Eigen::Matrix3d::Identity(), PositionBasedSettings{}};
  }

  Pose T_patient_model(double time_s) const {
    const Eigen::Vector3d moved = motion_.displacement(target, time_s);
    Pose T = Pose::Identity();
    T.linear() = expSO3(Eigen::Vector3d(degToRad(turn_deg) * moved.z() / 10e-3, 0, 0));
    T.translation() = target + moved - T.linear() * target;
    return T;
  }

 private:
  Pose seen(const Pose& T_camera_model) {
    Pose noisy = T_camera_model;
    const Eigen::Vector3d at = noisy * target, shift = random_.vector(1);
    noisy.linear() = expSO3(random_.vector(turn_noise_rad)) * noisy.linear();
    noisy.translation() =
        at + Eigen::Vector3d(lateral_noise_m * shift.x(), lateral_noise_m * shift.y(), depth_noise_m * shift.z()) -
        noisy.linear() * target;
    if (false_depth_m > 0 && random_.uniform(0, 1) < 1.0 / 3) {
      noisy.pretranslate(false_depth_m / at.z() * (noisy * target));
    }
    return noisy;
  }
  // Of translation and rotation as `seen` makes it: turns are about the target, which translation pays for.
  Matrix6d covariance(const Pose& T_camera_model) const {
    const Eigen::Matrix3d turned = turn_noise_rad * turn_noise_rad * Eigen::Matrix3d::Identity();
    const Eigen::Matrix3d lever = skew(T_camera_model.linear() * target);
    const Eigen::Vector3d std_m(lateral_noise_m, lateral_noise_m, depth_noise_m);
    Matrix6d C;
    C << Eigen::Matrix3d(std_m.cwiseAbs2().asDiagonal()) + lever * turned * lever.transpose(), lever * turned,
        turned * lever.transpose(), turned;
    return C;
  }

  Random random_;
  PatientMotion motion_;
};

inline MovingPatient::Errors MovingPatient::run(Task& task, double duration_s, double from_s) {
  constexpr std::int64_t kStep_us = 5000;
  const double period_s = 1.0 / 15;
  CArmJoints joints = carm.jointsFor({degToRad(20), degToRad(10)}, target);
  joints[2] += first_offset_m;
  SimulatedCArm arm(limits, joints, 0);
  CArmMotionLimiter limiter(limits, 0.2);
  std::deque<std::pair<std::int64_t, CArmCommand>> in_transit;  // By arrival.
  CArmCommand last;
  Errors errors;
  double sum = 0, beams = 0;
  int counted = 0;
  std::optional<Eigen::Vector3d> first_beam;
  std::int64_t now_us = 0;
  const auto advance = [&](std::int64_t until_us) {
    while (!in_transit.empty() && in_transit.front().first <= until_us) {
      arm.obey(in_transit.front().second, in_transit.front().first);
      in_transit.pop_front();
    }
    arm.advance(until_us);
    now_us = until_us;
  };
  for (int k = 0; k * period_s < duration_s; ++k) {
    const auto frame_us = static_cast<std::int64_t>(std::llround(1e6 * k * period_s));
    for (std::int64_t t = now_us + kStep_us; t < frame_us; t += kStep_us) {
      advance(t);
      const double time_s = 1e-6 * static_cast<double>(t);
      const CArmState state = arm.state();
      errors.max_share_of_limits =
          std::max(errors.max_share_of_limits, state.velocity.cwiseAbs().cwiseQuotient(limits.velocity).maxCoeff());
      const Pose T = carm.T_camera_patient(state.joints) * T_patient_model(time_s);
      const Eigen::Vector3d beam = T.linear().row(2).transpose();
      if (!first_beam) first_beam = beam;
      if (time_s < from_s) continue;
      const double off_mm = 1e3 * (T * target).head<2>().norm();
      sum += off_mm * off_mm;
      beams += std::pow(radToDeg(std::acos(std::min(1.0, beam.dot(*first_beam)))), 2);
      errors.worst_mm = std::max(errors.worst_mm, off_mm);
      ++counted;
    }
    advance(frame_us);
    const CArmState at_frame = [&] {
      CArmState s = arm.state();
      s.time_us = frame_us;
      return s;
    }();
    const Pose truth = carm.T_camera_patient(at_frame.joints) * T_patient_model(k * period_s);
    TaskInput input{frame_us,      carm.camera(), seen(truth), Matrix6d(covariance(truth)), truth, at_frame,
                    last.velocity, period_s,      latency_s};
    const TaskAnswer answer = task.answer(input);
    task.learn();
    if (!answer.velocity) ++errors.held;
    last.velocity = answer.velocity ? limiter.limit(*answer.velocity, at_frame.joints, latency_s, period_s)
                                    : limiter.rest(period_s);
    last.time_us = frame_us;
    ++last.sequence;
    last.valid_for_us = 200'000;
    in_transit.emplace_back(frame_us + std::llround(1e6 * latency_s), last);
  }
  errors.rms_mm = std::sqrt(sum / std::max(counted, 1));
  errors.beam_rms_deg = std::sqrt(beams / std::max(counted, 1));
  return errors;
}

}  // namespace angio::test
