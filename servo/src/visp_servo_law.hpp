// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <visp3/vs/vpServo.h>

#include "angio/servo/servo_law.hpp"

namespace angio::servo {

/// What the laws have in common: a vpServo task for a camera on an arm that cannot roll, and what must hold before and
/// after it computes.
class VispServoLaw {
 public:
  VispServoLaw(const ServoGain& gain, const std::optional<Eigen::Vector3d>& target);
  // vpServo holds features by address.
  VispServoLaw(const VispServoLaw&) = delete;
  VispServoLaw& operator=(const VispServoLaw&) = delete;
  ~VispServoLaw();

  /// The desired pose, turned about its beam to where the seen one is. Nothing when a number is not finite or the
  /// target lies behind either source.
  std::optional<Pose> goal(const LawInput& input);

  /// Where the camera is seen from; valid after goal().
  const Pose& T_camera_model() const { return seen_; }

  vpServo& servo() { return servo_; }

  /// The task's joint velocities, for features that are up to date.
  std::optional<CArmJoints> velocity(const LawInput& input);

 private:
  ServoGain gain_;
  std::optional<Eigen::Vector3d> target_;
  Pose seen_ = Pose::Identity();
  double error_rad_ = 0;  // As ServoGain has it.
  vpServo servo_;
};

}  // namespace angio::servo
