// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <visp3/vs/vpServo.h>

#include "angio/servo/servo_law.hpp"

namespace angio::servo {

/// What the laws have in common: the gain, a vpServo task for a camera on an arm that cannot roll, and what must hold
/// before and after it computes.
class VispServoLaw {
 public:
  VispServoLaw(const ServoGain& gain, const std::optional<Eigen::Vector3d>& target);
  // vpServo holds features by address.
  VispServoLaw(const VispServoLaw&) = delete;
  VispServoLaw& operator=(const VispServoLaw&) = delete;
  ~VispServoLaw();

  /// The desired pose, turned about its beam to where the seen one is. Nothing when a number is not finite or the
  /// target lies behind either source, or the Jacobian is not 6 x 5.
  std::optional<Pose> goal(const LawInput& input);

  /// Where the camera is seen from; valid after goal().
  const Pose& T_camera_model() const { return seen_; }

  /// The gain [1/s] at the seen pose's error; valid after goal().
  double lambda() const;

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

/// The remaining motion in joint space, times the gain. Nothing comes back without LawInput::joints_left.
std::unique_ptr<ServoLaw> make(const JointSpaceSettings& settings, const LawModel& model);

/// PBVS with ViSP's vpServo on vpFeatureTranslation (cdMc) and vpFeatureThetaU (cdRc).
///
/// A C-arm without detector rotation cannot turn its image about the beam, so the third component of theta u is left
/// out: five features for five joints.
std::unique_ptr<ServoLaw> make(const PositionBasedSettings& settings, const LawModel& model);

/// IBVS with ViSP's vpServo on one feature that stacks the images of centreline points, with their own depths.
/// Source: Chaumette & Hutchinson, "Visual servo control I", IEEE Robotics & Automation Magazine 13(4), 2006, eq. 11.
///
/// The points that count are those that the goal shows (all, when it shows fewer than eight): they are the same all the
/// way, so that the error does not jump when one comes into view. Throws InputError when the model has no tree.
std::unique_ptr<ServoLaw> make(const ImageBasedSettings& settings, const LawModel& model);

/// 2 1/2 D visual servoing with ViSP's vpFeaturePoint, vpFeatureDepth and vpFeatureThetaU (cdRc).
/// Source: Malis, Chaumette, Boudet, "2 1/2 D visual servoing", IEEE Trans. Robotics and Automation 15(2), 1999.
///
/// Throws InputError when the model names no target.
std::unique_ptr<ServoLaw> make(const HybridSettings& settings, const LawModel& model);

}  // namespace angio::servo
