// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/registration_gate.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "angio/test/errors.hpp"
#include "angio/test/not_a_number.hpp"

namespace angio::test {
namespace {

// A frame and a registration that pass every gate; each test closes one.
class RegistrationGates : public testing::Test {
 protected:
  RegistrationGates() {
    frame_.image = cv::Mat(64, 64, CV_16UC1, cv::Scalar(30000));
    frame_.time_us = 5'000'000;
    state_.time_us = 5'000'000;
    seen_.status = RegistrationStatus::kConverged;
    seen_.T_camera_model.translation() << 0.01, -0.02, 0.8;
    seen_.covariance = Matrix6d(Matrix6d::Identity() * 1e-8);
    predicted_ = calibrated_ = seen_.T_camera_model;
  }
  std::string rejection(bool tracking = true) const {
    return gate_.rejection(seen_, calibrated_, tracking ? std::optional(predicted_) : std::nullopt).value_or("");
  }
  std::string frameObjection() const { return gate_.rejection(frame_, state_).value_or(""); }
  void turn(double angle_deg) {
    seen_.T_camera_model.linear() = expSO3(Eigen::Vector3d(0, degToRad(angle_deg), 0));
    // About the target, which must not move with it.
    seen_.T_camera_model.translation() = predicted_ * target_ - seen_.T_camera_model.linear() * target_;
  }

  const Eigen::Vector3d target_{0.05, 0.02, 0.1};
  RegistrationGateSettings settings_;
  RegistrationGate gate_{settings_, target_};
  XrayFrame frame_{0, 1, {}, XrayCamera::centered(64, 64, 1e-3, 1)};
  CArmState state_;
  RegistrationResult seen_;
  Pose predicted_, calibrated_;
};

TEST_F(RegistrationGates, LetPassWhatIsSound) {
  EXPECT_EQ(frameObjection(), "");
  EXPECT_EQ(rejection(true), "");
  EXPECT_EQ(rejection(false), "");
}

TEST_F(RegistrationGates, OnlyConvergedMayMove) {
  for (const auto status :
       {RegistrationStatus::kAmbiguous, RegistrationStatus::kDiverged, RegistrationStatus::kTooFewPoints}) {
    seen_.status = status;
    seen_.reason = "because";
    EXPECT_EQ(rejection(), "registration " + statusName(status) + ": because");
  }
}

TEST_F(RegistrationGates, NumbersMustBeFinite) {
  const RegistrationResult sound = seen_;
  seen_.T_camera_model.translation().x() = kNan;
  EXPECT_EQ(rejection(), "registration is not finite");
  seen_ = sound;
  (*seen_.covariance)(2, 3) = kNan;
  EXPECT_EQ(rejection(), "registration is not finite");
  seen_ = sound;
  seen_.covariance.reset();
  EXPECT_EQ(rejection(), "registration is not finite") << "no covariance: no full-rank system";
  seen_ = sound;
  predicted_.linear()(1, 1) = kNan;
  EXPECT_NE(rejection(), "");
}

TEST_F(RegistrationGates, ATurnMayBeLargeOnlyWhileSearching) {
  turn(settings_.max_innovation_deg - 0.01);
  EXPECT_EQ(rejection(true), "");
  turn(settings_.max_innovation_deg + 0.01);
  EXPECT_NE(rejection(true).find("turn against the prediction"), std::string::npos);
  EXPECT_EQ(rejection(false), "");
  turn(settings_.max_calibration_offset_deg + 0.01);
  EXPECT_NE(rejection(false).find("turn against the calibration"), std::string::npos);
}

TEST_F(RegistrationGates, AShiftMayBeLargeOnlyWhileSearching) {
  const auto shift = [&](double mm) {
    seen_.T_camera_model.translation() = predicted_.translation() + Eigen::Vector3d(0, 1e-3 * mm, 0);
  };
  shift(settings_.max_innovation_mm - 0.01);
  EXPECT_EQ(rejection(true), "");
  shift(settings_.max_innovation_mm + 0.01);
  EXPECT_NE(rejection(true).find("shift against the prediction"), std::string::npos);
  EXPECT_EQ(rejection(false), "");
  shift(settings_.max_calibration_offset_mm + 0.01);
  EXPECT_NE(rejection(false).find("shift against the calibration"), std::string::npos);
}

// One view sees depth poorly: a tree that breathes jumps along the beam by what must not happen across it.
TEST_F(RegistrationGates, AJumpMayBeLargerAlongTheBeam) {
  const auto shift = [&](double mm) {
    seen_.T_camera_model.translation() = predicted_.translation() + Eigen::Vector3d(0, 0, 1e-3 * mm);
  };
  shift(settings_.max_innovation_depth_mm - 0.01);
  EXPECT_EQ(rejection(true), "");
  shift(settings_.max_innovation_depth_mm + 0.01);
  EXPECT_NE(rejection(true).find("depth against the prediction"), std::string::npos);
  shift(settings_.max_calibration_offset_mm + 0.01);
  EXPECT_NE(rejection(false).find("depth against the calibration"), std::string::npos);
}

TEST_F(RegistrationGates, ACreepingErrorEndsAtTheCalibration) {
  // Each step is small against the prediction, which has crept along.
  seen_.T_camera_model.translation().x() += 1e-3 * (settings_.max_calibration_offset_mm + 1);
  predicted_ = seen_.T_camera_model;
  EXPECT_NE(rejection(true).find("shift against the calibration"), std::string::npos);
}

TEST_F(RegistrationGates, TheUncertaintyIsThatOfTheTarget) {
  const double max_m = 1e-3 * settings_.max_target_std_mm;
  (*seen_.covariance)(2, 2) = std::pow(0.99 * max_m, 2);
  EXPECT_EQ(rejection(), "");
  (*seen_.covariance)(2, 2) = std::pow(1.01 * max_m, 2);
  EXPECT_NE(rejection().find("uncertainty of the target"), std::string::npos);
  // A rotation about the model's origin moves the target by its arm: here |(0.05, 0.1)| for a turn about y.
  (*seen_.covariance)(2, 2) = 1e-8;
  const double arm_m = std::hypot(target_.x(), target_.z());
  (*seen_.covariance)(4, 4) = std::pow(0.98 * max_m / arm_m, 2);
  EXPECT_EQ(rejection(), "");
  (*seen_.covariance)(4, 4) = std::pow(1.02 * max_m / arm_m, 2);
  EXPECT_NE(rejection().find("uncertainty of the target"), std::string::npos);
}

// A task in the image may move while depth is open; it may not while the image's directions are.
TEST_F(RegistrationGates, DepthMayBeOpenWhereATaskDoesNotNeedIt) {
  const RegistrationGate across(settings_, target_, TargetNeed::kAcrossBeam);
  const auto refused = [&] { return across.rejection(seen_, calibrated_, predicted_).value_or(""); };
  // An error of depth moves a point along its own ray, which is nothing in the image, also off the axis.
  const Eigen::Vector3d p = seen_.T_camera_model * target_;
  const Eigen::Vector3d along = 0.011 * p.normalized();
  seen_.covariance->topLeftCorner<3, 3>() += along * along.transpose();
  EXPECT_NE(rejection().find("uncertainty of the target"), std::string::npos);
  EXPECT_EQ(refused(), "");
  (*seen_.covariance)(0, 0) += std::pow(1.01e-3 * settings_.max_target_std_mm, 2);
  EXPECT_NE(refused().find("uncertainty of the target"), std::string::npos);
}

TEST_F(RegistrationGates, JointsMustBelongToTheFrame) {
  const std::int64_t max_us = std::llround(1e3 * settings_.max_state_age_ms);
  for (const int sign : {-1, 1}) {
    state_.time_us = frame_.time_us + sign * max_us;
    EXPECT_EQ(frameObjection(), "");
    state_.time_us += sign * 1000;
    EXPECT_NE(frameObjection().find("age of the joints"), std::string::npos);
  }
  frame_.time_us = std::numeric_limits<std::int64_t>::max();
  state_.time_us = std::numeric_limits<std::int64_t>::min();
  EXPECT_NE(frameObjection().find("different epochs"), std::string::npos) << "the difference does not fit";
}

TEST_F(RegistrationGates, JointsMustBeFinite) {
  state_.joints[3] = kNan;
  EXPECT_EQ(frameObjection(), "joints are not finite");
  state_.joints[3] = 0;
  state_.velocity[0] = kNan;
  EXPECT_EQ(frameObjection(), "joints are not finite");
}

TEST_F(RegistrationGates, AFrameMustHaveAnImageOfItsCamera) {
  frame_.image = cv::Mat();
  EXPECT_NE(frameObjection(), "");
  frame_.image = cv::Mat(64, 64, CV_8UC3);
  EXPECT_NE(frameObjection(), "");
  frame_.image = cv::Mat(32, 64, CV_8UC1);
  EXPECT_NE(frameObjection(), "");
  frame_.image = cv::Mat(64, 64, CV_8UC1);
  EXPECT_EQ(frameObjection(), "");
}

TEST_F(RegistrationGates, RefuseSettingsOutOfRange) {
  settings_.command_valid_ms = kNan;
  EXPECT_NE(test::refusalOf([&] { RegistrationGate(settings_, target_); }).find("command_valid_ms"), std::string::npos);
}

}  // namespace
}  // namespace angio::test
