// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_node.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "angio/messaging/channels.hpp"
#include "stage.hpp"

namespace angio {
namespace {

class ServoNodes : public testing::Test {
 protected:
  void say(const XrayFrame& frame) { publish(*bus_, kXrayFrameChannel, frame); }
  void say(const CArmState& state) { publish(*bus_, kCArmStateChannel, state); }
  void handle() { bus_->handle(std::chrono::milliseconds(0)); }

  test::Stage stage_;
  std::unique_ptr<Bus> bus_ = openBus("memq://");
  LatestValue<CArmCommand> commands_{*bus_, kCArmCommandChannel};
  LatestValue<RegistrationMessage> registrations_{*bus_, kRegistrationChannel};
  LatestValue<ServoStatus> statuses_{*bus_, kServoStatusChannel};
  ServoNode node_{*bus_, stage_.settings, stage_.tree};
};

TEST_F(ServoNodes, AnswerWhenFrameAndJointsHaveCome) {
  EXPECT_FALSE(node_.answer());
  say(stage_.frame(1));
  handle();
  EXPECT_FALSE(node_.answer()) << "where the arm is has not been said";
  say(stage_.state(1));
  handle();
  const auto report = node_.answer();
  ASSERT_TRUE(report);
  EXPECT_FALSE(node_.answer()) << "one answer a frame";
  handle();
  ASSERT_TRUE(commands_.peek() && registrations_.peek() && statuses_.peek());
  EXPECT_EQ(commands_.peek()->velocity, report->command.velocity);
  EXPECT_FALSE(commands_.peek()->velocity.isZero(0));
  EXPECT_EQ(registrations_.peek()->status_text, "converged");
  EXPECT_TRUE(registrations_.peek()->T_camera_model.isApprox(report->sight.registration.T_camera_model, 1e-12));
  EXPECT_EQ(statuses_.peek()->state, ServoState::kServo);
  EXPECT_EQ(statuses_.peek()->reason, "");
  EXPECT_DOUBLE_EQ(statuses_.peek()->view_error_rad, report->task.view_error->direction_rad);
}

TEST_F(ServoNodes, SayThatAndWhyTheyHold) {
  say(stage_.state(1));
  XrayFrame flat = stage_.frame(3);
  flat.image.setTo(30000);
  say(flat);
  handle();
  ASSERT_TRUE(node_.answer());
  handle();
  ASSERT_TRUE(commands_.peek() && registrations_.peek() && statuses_.peek());
  EXPECT_TRUE(commands_.peek()->velocity.isZero(0));
  EXPECT_EQ(commands_.peek()->frame_sequence, 3);
  EXPECT_EQ(commands_.peek()->valid_for_us, 200'000);
  EXPECT_EQ(statuses_.peek()->state, ServoState::kHold);
  EXPECT_NE(statuses_.peek()->reason.find("too_few_points"), std::string::npos);
  EXPECT_EQ(registrations_.peek()->status_text, "too_few_points");
}

TEST_F(ServoNodes, SurviveGarbageOnTheirChannels) {
  test::Random random(8);
  const auto garbage = [&](std::size_t size) {
    std::vector<std::uint8_t> bytes(size);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random.uniform(0, 256));
    return bytes;
  };
  for (const std::size_t size : {0, 1, 8, 100, 5000}) {
    bus_->publish(kXrayFrameChannel, garbage(size));
    bus_->publish(kCArmStateChannel, garbage(size));
  }
  bus_->publish(kXrayFrameChannel, encode(stage_.state(1)));  // Another type's message.
  auto cut = encode(stage_.frame(1));
  cut.resize(cut.size() / 2);
  bus_->publish(kXrayFrameChannel, cut);
  handle();
  EXPECT_FALSE(node_.answer());
  EXPECT_EQ(node_.refused(), 12);
  // Joints that are numbers, but of no arm.
  CArmState wild = stage_.state(1);
  wild.joints.setConstant(1e300);
  say(wild);
  say(stage_.frame(1));
  handle();
  const auto held = node_.answer();
  ASSERT_TRUE(held);
  EXPECT_TRUE(held->held && held->command.velocity.isZero(0));
  say(stage_.state(2));
  say(stage_.frame(2));
  handle();
  const auto report = node_.answer();
  ASSERT_TRUE(report);
  EXPECT_FALSE(report->held) << *report->held;
}

TEST(ServoMessages, AResultWithoutNumbersCanBeSent) {
  ServoReport report;
  report.held = "registration diverged";
  report.sight.registration.status = RegistrationStatus::kDiverged;
  report.sight.registration.T_camera_model.matrix().setConstant(std::numeric_limits<double>::quiet_NaN());
  report.sight.registration.covariance = Matrix6d(-Matrix6d::Identity());
  report.sight.registration.agreement.model_residual_px = std::numeric_limits<double>::infinity();
  const RegistrationMessage message = registrationMessage(report);
  EXPECT_NO_THROW(encode(message));
  EXPECT_EQ(message.status_text, "diverged");
  EXPECT_NO_THROW(encode(servoStatus(report)));
}

}  // namespace
}  // namespace angio
