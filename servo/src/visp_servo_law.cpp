// SPDX-License-Identifier: GPL-2.0-or-later
#include "visp_servo_law.hpp"

#include <visp3/vs/vpAdaptiveGain.h>

#include <cmath>

namespace angio::servo {
namespace {

// Plain numbers: what is no rotation was refused by whoever made the poses, and what is not finite is refused here.
Pose poseOf(const vpHomogeneousMatrix& M) {
  Pose T;
  for (unsigned r = 0; r < 4; ++r) {
    for (unsigned c = 0; c < 4; ++c) T.matrix()(r, c) = M[r][c];
  }
  return T;
}

}  // namespace

VispServoLaw::VispServoLaw(const ServoGain& gain, const std::optional<Eigen::Vector3d>& target)
    : gain_(gain), target_(target) {
  servo_.setServo(vpServo::EYEINHAND_L_cVe_eJe);
  servo_.setInteractionMatrixType(vpServo::CURRENT, vpServo::PSEUDO_INVERSE);
  servo_.set_cVe(vpVelocityTwistMatrix());  // The camera is the end-effector.
}

VispServoLaw::~VispServoLaw() { servo_.kill(); }

std::optional<Pose> VispServoLaw::goal(const LawInput& input) {
  if (input.eJe.getRows() != 6 || input.eJe.getCols() != kCArmJointCount) return std::nullopt;
  for (unsigned i = 0; i < input.eJe.size(); ++i) {
    if (!std::isfinite(input.eJe.data[i])) return std::nullopt;
  }
  seen_ = poseOf(input.cMo);
  Pose desired = poseOf(input.cdMo);
  if (!seen_.matrix().allFinite() || !desired.matrix().allFinite()) return std::nullopt;
  const Eigen::Matrix3d R = seen_.linear(), Rd = desired.linear();
  const Eigen::Vector3d beam = R.row(2).transpose(), desired_beam = Rd.row(2).transpose();
  const Eigen::Matrix3d aligned = R * Eigen::Quaterniond::FromTwoVectors(desired_beam, beam).toRotationMatrix();
  const Eigen::Matrix3d roll = aligned * Rd.transpose();
  desired.linear() = aligned;
  desired.translation() = (roll * desired.translation()).eval();
  error_rad_ = std::atan2(beam.cross(desired_beam).norm(), beam.dot(desired_beam));
  const Eigen::Vector3d reference = target_.value_or(Eigen::Vector3d::Zero());
  const Eigen::Vector3d target = seen_ * reference, desired_target = desired * reference;
  if (target_ && !(target.z() > 0 && desired_target.z() > 0)) return std::nullopt;
  error_rad_ += (target - desired_target).norm() / std::max(desired_target.norm(), 1e-3);
  return desired;
}

double VispServoLaw::lambda() const {
  const double change = gain_.lambda_at_goal_per_s - gain_.lambda_per_s;
  return vpAdaptiveGain(gain_.lambda_at_goal_per_s, gain_.lambda_per_s, change / degToRad(gain_.gain_change_deg))
      .value(error_rad_);
}

std::optional<CArmJoints> VispServoLaw::velocity(const LawInput& input) {
  // The goal turns with the camera about the beam, so that a turn about it changes no error.
  vpMatrix eJe = input.eJe;
  for (unsigned i = 0; i < kCArmJointCount; ++i) eJe[5][i] = 0;
  servo_.set_eJe(eJe);
  servo_.setLambda(lambda());
  const vpColVector qdot = servo_.computeControlLaw();
  if (servo_.getTaskRank() != kCArmJointCount || qdot.size() != kCArmJointCount) return std::nullopt;
  CArmJoints result;
  for (int i = 0; i < kCArmJointCount; ++i) result[i] = qdot[static_cast<unsigned>(i)];
  if (!result.allFinite()) return std::nullopt;
  return result;
}

std::unique_ptr<ServoLaw> makeServoLaw(const ServoLawSettings& settings, const LawModel& model) {
  return std::visit([&](const auto& chosen) { return make(chosen, model); }, settings);
}

}  // namespace angio::servo
