// SPDX-License-Identifier: GPL-2.0-or-later
#include "visp_servo_law.hpp"

#include <visp3/visual_features/vpFeatureDepth.h>
#include <visp3/visual_features/vpFeaturePoint.h>
#include <visp3/visual_features/vpFeatureThetaU.h>
#include <visp3/visual_features/vpFeatureTranslation.h>
#include <visp3/vs/vpAdaptiveGain.h>

#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/geometry/visp.hpp"

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

namespace {

class JointSpace final : public ServoLaw {
 public:
  JointSpace(const JointSpaceSettings& settings, const LawModel& model) : task_(settings, model.target) {}

  std::optional<CArmJoints> velocity(const LawInput& input) override {
    if (!input.joints_left || !input.joints_left->allFinite() || !task_.goal(input)) return std::nullopt;
    return CArmJoints(task_.lambda() * *input.joints_left);
  }

 private:
  VispServoLaw task_;
};

class PositionBased final : public ServoLaw {
 public:
  PositionBased(const PositionBasedSettings& settings, const LawModel& model)
      : translation_(vpFeatureTranslation::cdMc),
        desired_translation_(vpFeatureTranslation::cdMc),
        theta_u_(vpFeatureThetaU::cdRc),
        desired_theta_u_(vpFeatureThetaU::cdRc),
        task_(settings, model.target) {
    task_.servo().addFeature(translation_, desired_translation_);
    task_.servo().addFeature(theta_u_, desired_theta_u_, vpFeatureThetaU::selectTUx() | vpFeatureThetaU::selectTUy());
  }

  std::optional<CArmJoints> velocity(const LawInput& input) override {
    const auto goal = task_.goal(input);
    if (!goal) return std::nullopt;
    const vpHomogeneousMatrix cdMc = toVisp(Pose(*goal * task_.T_camera_model().inverse()));
    translation_.buildFrom(cdMc);
    theta_u_.buildFrom(cdMc);
    return task_.velocity(input);
  }

 private:
  vpFeatureTranslation translation_, desired_translation_;
  vpFeatureThetaU theta_u_, desired_theta_u_;
  VispServoLaw task_;  // Last: goes before the features that it holds.
};

class Hybrid final : public ServoLaw {
 public:
  Hybrid(const HybridSettings& settings, const LawModel& model)
      : target_(*model.target),
        theta_u_(vpFeatureThetaU::cdRc),
        desired_theta_u_(vpFeatureThetaU::cdRc),
        task_(settings, model.target) {
    task_.servo().addFeature(point_, desired_point_);
    task_.servo().addFeature(depth_);  // Towards log(Z / Z*) = 0.
    task_.servo().addFeature(theta_u_, desired_theta_u_, vpFeatureThetaU::selectTUx() | vpFeatureThetaU::selectTUy());
  }

  std::optional<CArmJoints> velocity(const LawInput& input) override {
    const auto goal = task_.goal(input);
    if (!goal) return std::nullopt;
    const Eigen::Vector3d p = task_.T_camera_model() * target_, pd = *goal * target_;
    point_.set_xyZ(p.x() / p.z(), p.y() / p.z(), p.z());
    desired_point_.set_xyZ(pd.x() / pd.z(), pd.y() / pd.z(), pd.z());
    depth_.buildFrom(p.x() / p.z(), p.y() / p.z(), p.z(), std::log(p.z() / pd.z()));
    theta_u_.buildFrom(toVisp(Pose(*goal * task_.T_camera_model().inverse())));
    return task_.velocity(input);
  }

 private:
  Eigen::Vector3d target_;
  vpFeaturePoint point_, desired_point_;
  vpFeatureDepth depth_;
  vpFeatureThetaU theta_u_, desired_theta_u_;
  VispServoLaw task_;  // Last: goes before the features that it holds.
};

}  // namespace

std::unique_ptr<ServoLaw> make(const JointSpaceSettings& settings, const LawModel& model) {
  return std::make_unique<JointSpace>(settings, model);
}

std::unique_ptr<ServoLaw> make(const PositionBasedSettings& settings, const LawModel& model) {
  return std::make_unique<PositionBased>(settings, model);
}

std::unique_ptr<ServoLaw> make(const HybridSettings& settings, const LawModel& model) {
  if (!model.target) throw InputError(HybridSettings::kName, "target", "", "the law needs one");
  return std::make_unique<Hybrid>(settings, model);
}

std::unique_ptr<ServoLaw> makeServoLaw(const ServoLawSettings& settings, const LawModel& model) {
  return madeOf(settings, [&](const auto& chosen) { return make(chosen, model); });
}

}  // namespace angio::servo
