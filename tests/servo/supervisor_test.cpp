// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/supervisor.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "angio/test/errors.hpp"

namespace angio {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// A frame and a registration that pass every gate; each test closes one.
class Supervisors : public testing::Test {
 protected:
  Supervisors() {
    frame_.image = cv::Mat(64, 64, CV_16UC1, cv::Scalar(30000));
    frame_.time_us = 5'000'000;
    state_.time_us = 5'000'000;
    seen_.status = RegistrationStatus::kConverged;
    seen_.T_camera_model.translation() << 0.01, -0.02, 0.8;
    seen_.covariance = Matrix6d(Matrix6d::Identity() * 1e-8);
    predicted_ = calibrated_ = seen_.T_camera_model;
  }
  std::string objection(bool tracking = true) const {
    return supervisor_.objection(seen_, calibrated_, tracking ? std::optional(predicted_) : std::nullopt).value_or("");
  }
  std::string frameObjection() const { return supervisor_.objection(frame_, state_).value_or(""); }
  void turn(double angle_deg) {
    seen_.T_camera_model.linear() = expSO3(Eigen::Vector3d(0, degToRad(angle_deg), 0));
    // About the target, which must not move with it.
    seen_.T_camera_model.translation() = predicted_ * target_ - seen_.T_camera_model.linear() * target_;
  }

  const Eigen::Vector3d target_{0.05, 0.02, 0.1};
  SupervisorSettings settings_;
  CArmLimits limits_ = CArmLimits::typical();
  Supervisor supervisor_{settings_, limits_, target_};
  XrayFrame frame_{0, 1, {}, XrayCamera::centred(64, 64, 1e-3, 1)};
  CArmState state_;
  RegistrationResult seen_;
  Pose predicted_, calibrated_;
};

TEST_F(Supervisors, LetPassWhatIsSound) {
  EXPECT_EQ(frameObjection(), "");
  EXPECT_EQ(objection(true), "");
  EXPECT_EQ(objection(false), "");
}

TEST_F(Supervisors, OnlyConvergedMayMove) {
  for (const auto status :
       {RegistrationStatus::kAmbiguous, RegistrationStatus::kDiverged, RegistrationStatus::kTooFewPoints}) {
    seen_.status = status;
    seen_.reason = "because";
    EXPECT_EQ(objection(), "registration " + statusName(status) + ": because");
  }
}

TEST_F(Supervisors, NumbersMustBeFinite) {
  const RegistrationResult sound = seen_;
  seen_.T_camera_model.translation().x() = kNan;
  EXPECT_EQ(objection(), "registration is not finite");
  seen_ = sound;
  (*seen_.covariance)(2, 3) = kNan;
  EXPECT_EQ(objection(), "registration is not finite");
  seen_ = sound;
  seen_.covariance.reset();
  EXPECT_EQ(objection(), "registration is not finite") << "no covariance: no full-rank system";
  seen_ = sound;
  predicted_.linear()(1, 1) = kNan;
  EXPECT_NE(objection(), "");
}

TEST_F(Supervisors, ATurnMayBeLargeOnlyWhileSearching) {
  turn(settings_.most_jump_deg - 0.01);
  EXPECT_EQ(objection(true), "");
  turn(settings_.most_jump_deg + 0.01);
  EXPECT_NE(objection(true).find("turn against the prediction"), std::string::npos);
  EXPECT_EQ(objection(false), "");
  turn(settings_.most_correction_deg + 0.01);
  EXPECT_NE(objection(false).find("turn against the calibration"), std::string::npos);
}

TEST_F(Supervisors, AShiftMayBeLargeOnlyWhileSearching) {
  const auto shift = [&](double mm) {
    seen_.T_camera_model.translation() = predicted_.translation() + Eigen::Vector3d(0, 1e-3 * mm, 0);
  };
  shift(settings_.most_jump_mm - 0.01);
  EXPECT_EQ(objection(true), "");
  shift(settings_.most_jump_mm + 0.01);
  EXPECT_NE(objection(true).find("shift against the prediction"), std::string::npos);
  EXPECT_EQ(objection(false), "");
  shift(settings_.most_correction_mm + 0.01);
  EXPECT_NE(objection(false).find("shift against the calibration"), std::string::npos);
}

// One view sees depth poorly: a tree that breathes jumps along the beam by what must not happen across it.
TEST_F(Supervisors, AJumpMayBeLargerAlongTheBeam) {
  const auto shift = [&](double mm) {
    seen_.T_camera_model.translation() = predicted_.translation() + Eigen::Vector3d(0, 0, 1e-3 * mm);
  };
  shift(settings_.most_jump_depth_mm - 0.01);
  EXPECT_EQ(objection(true), "");
  shift(settings_.most_jump_depth_mm + 0.01);
  EXPECT_NE(objection(true).find("depth against the prediction"), std::string::npos);
  shift(settings_.most_correction_mm + 0.01);
  EXPECT_NE(objection(false).find("depth against the calibration"), std::string::npos);
}

TEST_F(Supervisors, ACreepingErrorEndsAtTheCalibration) {
  // Each step is small against the prediction, which has crept along.
  seen_.T_camera_model.translation().x() += 1e-3 * (settings_.most_correction_mm + 1);
  predicted_ = seen_.T_camera_model;
  EXPECT_NE(objection(true).find("shift against the calibration"), std::string::npos);
}

TEST_F(Supervisors, TheUncertaintyIsThatOfTheTarget) {
  const double most_m = 1e-3 * settings_.most_target_std_mm;
  (*seen_.covariance)(2, 2) = std::pow(0.99 * most_m, 2);
  EXPECT_EQ(objection(), "");
  (*seen_.covariance)(2, 2) = std::pow(1.01 * most_m, 2);
  EXPECT_NE(objection().find("uncertainty of the target"), std::string::npos);
  // A rotation about the model's origin moves the target by its arm: here |(0.05, 0.1)| for a turn about y.
  (*seen_.covariance)(2, 2) = 1e-8;
  const double arm_m = std::hypot(target_.x(), target_.z());
  (*seen_.covariance)(4, 4) = std::pow(0.98 * most_m / arm_m, 2);
  EXPECT_EQ(objection(), "");
  (*seen_.covariance)(4, 4) = std::pow(1.02 * most_m / arm_m, 2);
  EXPECT_NE(objection().find("uncertainty of the target"), std::string::npos);
}

// A task in the image may move while depth is open; it may not while the image's directions are.
TEST_F(Supervisors, DepthMayBeOpenWhereATaskDoesNotNeedIt) {
  const Supervisor across(settings_, limits_, target_, TargetNeed::kAcrossBeam);
  const auto refused = [&] { return across.objection(seen_, calibrated_, predicted_).value_or(""); };
  // An error of depth moves a point along its own ray, which is nothing in the image, also off the axis.
  const Eigen::Vector3d p = seen_.T_camera_model * target_;
  const Eigen::Vector3d along = 0.011 * p.normalized();
  seen_.covariance->topLeftCorner<3, 3>() += along * along.transpose();
  EXPECT_NE(objection().find("uncertainty of the target"), std::string::npos);
  EXPECT_EQ(refused(), "");
  (*seen_.covariance)(0, 0) += std::pow(1.01e-3 * settings_.most_target_std_mm, 2);
  EXPECT_NE(refused().find("uncertainty of the target"), std::string::npos);
}

TEST_F(Supervisors, JointsMustBelongToTheFrame) {
  const std::int64_t most_us = std::llround(1e3 * settings_.most_state_age_ms);
  for (const int sign : {-1, 1}) {
    state_.time_us = frame_.time_us + sign * most_us;
    EXPECT_EQ(frameObjection(), "");
    state_.time_us += sign * 1000;
    EXPECT_NE(frameObjection().find("age of the joints"), std::string::npos);
  }
  frame_.time_us = std::numeric_limits<std::int64_t>::max();
  state_.time_us = std::numeric_limits<std::int64_t>::min();
  EXPECT_NE(frameObjection().find("age of the joints"), std::string::npos) << "the difference does not fit";
}

TEST_F(Supervisors, JointsMustBeFinite) {
  state_.joints[3] = kNan;
  EXPECT_EQ(frameObjection(), "joints are not finite");
  state_.joints[3] = 0;
  state_.velocity[0] = kNan;
  EXPECT_EQ(frameObjection(), "joints are not finite");
}

TEST_F(Supervisors, AFrameMustHaveAnImageOfItsCamera) {
  frame_.image = cv::Mat();
  EXPECT_NE(frameObjection(), "");
  frame_.image = cv::Mat(64, 64, CV_8UC3);
  EXPECT_NE(frameObjection(), "");
  frame_.image = cv::Mat(32, 64, CV_8UC1);
  EXPECT_NE(frameObjection(), "");
  frame_.image = cv::Mat(64, 64, CV_8UC1);
  EXPECT_EQ(frameObjection(), "");
}

// What the limiter keeps is tested where it is; here, that it is asked, and hears of what did not go out.
TEST_F(Supervisors, LimitsCountFromWhatWentOut) {
  const double period_s = 1.0 / 15, latency_s = 0.08;
  const CArmJoints wanted = 100 * CArmJoints::Ones();
  CArmJoints last = CArmJoints::Zero();
  for (int k = 0; k < 10; ++k) {
    const CArmJoints v = supervisor_.limit(wanted, state_, latency_s, period_s);
    EXPECT_LE((v - last).cwiseAbs().cwiseQuotient(limits_.acceleration * period_s).maxCoeff(), 1 + 1e-12);
    EXPECT_LE(v.cwiseAbs().cwiseQuotient(limits_.velocity).maxCoeff(), 1 + 1e-12);
    EXPECT_GT(v.minCoeff(), last.minCoeff());
    last = v;
    state_.joints += period_s * v;
  }
  supervisor_.takeBack();
  const CArmJoints after = supervisor_.limit(wanted, state_, latency_s, period_s);
  EXPECT_LT(after[0], last[0]) << "as if the command that was taken back had moved the arm";
  state_.joints[0] = kNan;
  EXPECT_TRUE(supervisor_.limit(wanted, state_, latency_s, period_s).isZero(0));
}

TEST_F(Supervisors, RefuseSettingsOutOfRange) {
  settings_.command_valid_ms = kNan;
  EXPECT_NE(test::refusalOf([&] { Supervisor(settings_, limits_, target_); }).find("command_valid_ms"),
            std::string::npos);
}

}  // namespace
}  // namespace angio
