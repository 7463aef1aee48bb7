// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_node.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "angio/messaging/disturbed_bus.hpp"
#include "angio/messaging/recording_bus.hpp"
#include "angio/servo/replay.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/types/channels.hpp"
#include "stage.hpp"

namespace angio::test {
namespace {

class ServoNodes : public testing::Test {
 protected:
  void SetUp() override { test::start(*bus_, node_); }
  std::optional<ServoReport> answer() { return node_.answer(now_us_ += 66'667); }
  void say(const XrayFrame& frame) { publish(*bus_, kXrayFrameChannel, frame); }
  void say(const CArmState& state) { publish(*bus_, kCArmStateChannel, state); }
  void handle() { bus_->handle(std::chrono::milliseconds(0)); }

  test::Stage stage_;
  std::unique_ptr<Bus> bus_ = openBus("memq://");
  LatestMessage<CArmCommand> commands_{*bus_, kCArmCommandChannel};
  LatestMessage<RegistrationMessage> registrations_{*bus_, kRegistrationChannel};
  LatestMessage<ServoStatus> statuses_{*bus_, kServoStatusChannel};
  ServoNode node_{*bus_, test::moving(stage_.settings), stage_.tree};
  std::int64_t now_us_ = 2;
};

TEST_F(ServoNodes, AnswerWhenFrameAndJointsHaveCome) {
  EXPECT_FALSE(answer());
  say(stage_.frame(1));
  handle();
  EXPECT_FALSE(answer()) << "where the arm is has not been said";
  say(stage_.state(1));
  handle();
  const auto report = answer();
  ASSERT_TRUE(report);
  EXPECT_FALSE(answer()) << "one answer a frame";
  handle();
  ASSERT_TRUE(commands_.peek() && registrations_.peek() && statuses_.peek());
  EXPECT_EQ(commands_.peek()->velocity, report->command.velocity);
  EXPECT_FALSE(commands_.peek()->velocity.isZero(0));
  EXPECT_EQ(registrations_.peek()->status_text, "converged");
  EXPECT_TRUE(registrations_.peek()->T_camera_model.isApprox(report->observation.registration.T_camera_model, 1e-12));
  EXPECT_EQ(statuses_.peek()->state, ServoState::kServo);
  EXPECT_EQ(statuses_.peek()->reason, "");
  EXPECT_DOUBLE_EQ(statuses_.peek()->view_error_rad, report->task.view_error->direction_rad);
}

// A task without a view says how far its target is.
TEST(ServoStatusOfCenter, SaysTheTargetsError) {
  test::Stage stage;
  stage.settings.task = CenterTaskSettings{};
  stage.joints[2] += 5e-3;
  ServoLoop loop(stage.settings, stage.tree);
  const ServoReport report = loop.step(stage.frame(1), stage.state(1));
  ASSERT_FALSE(report.hold_reason) << *report.hold_reason;
  const ServoStatus status = servoStatus(report);
  EXPECT_EQ(status.view_error_rad, 0);
  EXPECT_NEAR(status.target_error_m, 5e-3, 0.5e-3);
}

TEST_F(ServoNodes, SayThatAndWhyTheyHold) {
  say(stage_.state(1));
  XrayFrame flat = stage_.frame(3);
  flat.image.setTo(30000);
  say(flat);
  handle();
  ASSERT_TRUE(answer());
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
  EXPECT_FALSE(answer());
  EXPECT_EQ(node_.refused(), 12);
  say(stage_.state(1));
  say(stage_.frame(1));
  handle();
  const auto report = answer();
  ASSERT_TRUE(report);
  EXPECT_FALSE(report->hold_reason) << *report->hold_reason;
}

// What no noise makes of joints is an arm, or a sender, that a person has to look at.
TEST_F(ServoNodes, JointsOfNoArmAreAFault) {
  CArmState wild = stage_.state(1);
  wild.joints.setConstant(1e300);
  say(wild);
  say(stage_.frame(1));
  for (const std::int64_t next : {2, 3}) {
    handle();
    const auto report = answer();
    ASSERT_TRUE(report);
    EXPECT_TRUE(report->hold_reason && report->command.velocity.isZero(0));
    EXPECT_EQ(node_.safety().states().state(), ServoState::kFault);
    say(stage_.state(next));
    say(stage_.frame(next));
  }
}

TEST(ServoMessages, AResultWithoutNumbersCanBeSent) {
  ServoReport report;
  report.hold_reason = "registration diverged";
  report.observation.registration.status = RegistrationStatus::kDiverged;
  report.observation.registration.T_camera_model.matrix().setConstant(std::numeric_limits<double>::quiet_NaN());
  report.observation.registration.covariance = Matrix6d(-Matrix6d::Identity());
  report.observation.registration.alignment.model_residual_px = std::numeric_limits<double>::infinity();
  const RegistrationMessage message = registrationMessage(report);
  EXPECT_NO_THROW(encode(message));
  EXPECT_EQ(message.status_text, "diverged");
  EXPECT_NO_THROW(encode(servoStatus(report)));
}

// A loop under its supervisor, whose arm does what it is told.
struct SupervisedRun : testing::Test {
  // One frame of the arm where it is; returns the command that answers it.
  CArmCommand frame() {
    ++k;
    publish(*bus, kCArmStateChannel, CArmState{k * kPeriod_us, k, stage.joints, last.velocity});
    publish(*bus, kXrayFrameChannel, stage.frame(k));
    while (bus->handle(std::chrono::milliseconds(0)) > 0) continue;
    const auto report = node.answer(k * kPeriod_us);
    EXPECT_TRUE(report);
    if (report) last = report->command;
    while (bus->handle(std::chrono::milliseconds(0)) > 0) continue;
    stage.joints += last.velocity * 1e-6 * kPeriod_us;
    return last;
  }
  void ask(ServoRequestKind kind) {
    // Each time another person, who has seen one status.
    Operator person(recorded);
    frame();
    person.ask(kind, k * kPeriod_us + 1000);
  }
  bool still(int frames) {
    bool all = true;
    for (int i = 0; i < frames; ++i) all = frame().velocity.isZero(0) && all;
    return all;
  }

  test::Stage stage;
  test::TemporaryFolder folder;
  std::string log = folder.path("run.lcm");
  std::unique_ptr<Bus> bus = openBus("memq://");
  RecordingBus recorded{*bus, log};
  ServoNode node{recorded, stage.settings, stage.tree};
  CArmCommand last;
  std::int64_t k = 0;
};

TEST_F(SupervisedRun, MovesOnlyBetweenStartAndEmergencyStop) {
  EXPECT_TRUE(still(3));
  ask(ServoRequestKind::kArm);
  EXPECT_TRUE(still(2));
  EXPECT_EQ(node.safety().states().state(), ServoState::kArmed);
  ask(ServoRequestKind::kStart);
  EXPECT_FALSE(still(8));
  EXPECT_EQ(node.safety().states().state(), ServoState::kServo);
  ask(ServoRequestKind::kEmergencyStop);
  EXPECT_TRUE(still(3));
  ask(ServoRequestKind::kStart);
  EXPECT_TRUE(still(3)) << "only a reset and arming anew lead out of it";
  EXPECT_EQ(node.safety().states().state(), ServoState::kEmergencyStop);
}

TEST_F(SupervisedRun, StopsWithTheCathetersEmergencyStopAlone) {
  ask(ServoRequestKind::kArm);
  ask(ServoRequestKind::kStart);
  EXPECT_FALSE(still(8));
  Operator other(recorded, OperatedMachine::kCatheter);
  other.ask(ServoRequestKind::kStop, k * kPeriod_us + 1000);
  frame();
  EXPECT_EQ(node.safety().states().state(), ServoState::kServo);
  other.ask(ServoRequestKind::kEmergencyStop, k * kPeriod_us + 2000);
  EXPECT_TRUE(still(3));
  EXPECT_EQ(node.safety().states().state(), ServoState::kEmergencyStop);
}

TEST_F(SupervisedRun, IsReplayedBitForBitWithWhatItsSupervisorTookBack) {
  ask(ServoRequestKind::kArm);
  ask(ServoRequestKind::kStart);
  for (int i = 0; i < 6; ++i) frame();
  ask(ServoRequestKind::kStop);
  for (int i = 0; i < 2; ++i) frame();
  const test::Stage fresh;
  const ReplaySummary found = replay<ServoLoop>(log, {}, fresh.settings, fresh.tree);
  EXPECT_EQ(found.first_difference.value_or(""), "");
  EXPECT_EQ(found.equal, found.commands);
  EXPECT_GT(found.held, 2);
  EXPECT_LT(found.held, found.answered);
}

// What programs do that are told to begin at once: a start that is lost, or refused because it answers a status from
// before the first frame, must not be the last one.
TEST_F(SupervisedRun, BeginsEvenWhereTheFirstStartComesToNothing) {
  DisturbedBus network(recorded, {}, 1);
  Operator starter(network);
  const auto frames = [&](int count) {
    for (int i = 0; i < count; ++i) {
      frame();
      starter.start(k * kPeriod_us + 1);
    }
  };
  frames(3);
  ASSERT_EQ(node.safety().states().state(), ServoState::kArmed);
  DisturbanceSettings deaf;
  deaf.loss_probability = 1;
  network.disturb(kServoRequestChannel, deaf);
  frames(5);
  ASSERT_EQ(node.safety().states().state(), ServoState::kArmed);
  network.disturb(kServoRequestChannel, {});
  frames(8);
  EXPECT_EQ(node.safety().states().state(), ServoState::kServo);
  Operator person(recorded);
  frame();
  person.ask(ServoRequestKind::kEmergencyStop, k * kPeriod_us + 2);
  frames(8);
  EXPECT_EQ(node.safety().states().state(), ServoState::kEmergencyStop) << "whatever stopped it, a person did";
}

}  // namespace
}  // namespace angio::test
