// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/second_senders.hpp"

#include <gtest/gtest.h>

#include "angio/messaging/disturbed_bus.hpp"
#include "angio/messaging/recording_bus.hpp"
#include "angio/servo/replay.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/types/channels.hpp"
#include "stage.hpp"

namespace angio::test {
namespace {

const std::string kA = "10.0.0.1:40001", kB = "10.0.0.2:40002";

TEST(SenderWatch, NamesTwoThatSendInTurns) {
  SenderWatch states;  // 100 a second from each.
  std::optional<std::string> found;
  std::int64_t now_us = 0, k = 0;
  for (; k < 100; ++k, now_us += 10'000) ASSERT_FALSE(states.hear(kA, k, now_us, now_us));
  found = states.hear(kB, 5, now_us, now_us);
  EXPECT_EQ(found.value_or(""), kA + " and " + kB);

  SenderWatch frames;  // Four a second.
  EXPECT_FALSE(frames.hear(kA, 1, 0, 0));
  EXPECT_FALSE(frames.hear(kB, 9, 200'000, 200'000)) << "the first may have ended";
  EXPECT_EQ(frames.hear(kA, 2, 250'000, 250'000).value_or(""), kA + " and " + kB);
}

TEST(SenderWatch, TakesOneThatBeginsAgainForOne) {
  SenderWatch watch;
  std::int64_t now_us = 0;
  for (std::int64_t k = 1; k < 100; ++k, now_us += 10'000) ASSERT_FALSE(watch.hear(kA, k, now_us, now_us));
  now_us += 300'000;
  for (std::int64_t k = 1; k < 100; ++k, now_us += 10'000) ASSERT_FALSE(watch.hear(kB, k, now_us, now_us));
  // A clock that was set back, late messages, and some that come twice.
  for (std::int64_t k = 1; k < 100; ++k) {
    now_us += 10'000;
    for (const std::int64_t number : {k, k, k - 3}) {
      ASSERT_FALSE(watch.hear(kB, number, number * 10'000 - 7'000'000, now_us)) << k;
    }
  }
  for (int k = 0; k < 100; ++k) ASSERT_FALSE(watch.hear("", 100 - k, k % 2, now_us)) << "nobody is known";
}

TEST(SenderWatch, TellsTwoOfOneAddressByNumbersAndTimes) {
  for (const std::int64_t offset_us : {std::int64_t{3'000}, std::int64_t{-3'600'000'000}}) {
    SenderWatch watch;
    std::optional<std::string> found;
    std::int64_t took_us = 0;
    for (std::int64_t k = 0; k < 20 && !found; ++k) {
      took_us = k * 10'000;
      found = watch.hear(kA, 1000 + k, took_us, took_us);
      if (!found) found = watch.hear(kA, 5 + k, took_us + offset_us, took_us + 3'000);
    }
    EXPECT_EQ(found.value_or(""), "both from " + kA);
    EXPECT_LT(took_us, 100'000);
  }
}

TEST(SenderWatch, DoesNotCallANumberThatStandsStillTwoSenders) {
  SenderWatch watch;
  for (std::int64_t k = 1; k < 100; ++k) ASSERT_FALSE(watch.hear(kA, 7, k * 10'000, k * 10'000)) << k;
}

// A loop that servoes at its party's side of a bus, while another party may speak as well.
struct TwoParties : testing::Test {
  void SetUp() override {
    test::start(recorded, node);
    for (int i = 0; i < 8; ++i) frame();
    ASSERT_EQ(node.states().state(), ServoState::kServo);
  }
  void handle() {
    while (bus->handle(std::chrono::milliseconds(0)) > 0) continue;
  }
  void frame() {
    ++k;
    side.advance(k * kPeriod_us);
    publish(*bus, kCArmStateChannel, CArmState{k * kPeriod_us, k, stage.joints, last.velocity});
    publish(*bus, kXrayFrameChannel, stage.frame(k));
    handle();
    const auto report = node.answer(k * kPeriod_us);
    ASSERT_TRUE(report);
    last = report->command;
    handle();
    stage.joints += last.velocity * 1e-6 * kPeriod_us;
  }

  test::Stage stage;
  test::TemporaryFolder folder;
  std::string log = folder.path("run.lcm");
  std::unique_ptr<Bus> bus = openBus("memq://");
  DisturbedBus side{*bus, {}, 1};
  RecordingBus recorded{side, log};
  MessageQueue<ServoSession> sessions{*bus, kServoSessionChannel};
  ServoNode node{recorded, stage.settings, stage.tree};
  CArmCommand last;
  std::int64_t k = 0;
};

TEST_F(TwoParties, ACommandOfAnotherProgramIsAFaultAndReplayedBitForBit) {
  CArmCommand forged = last;
  forged.sequence += 1;
  publish(*bus, kCArmCommandChannel, forged);
  frame();
  EXPECT_EQ(node.states().state(), ServoState::kFault);
  EXPECT_EQ(node.states().log().back().cause, ServoCause::kSecondSender);
  EXPECT_EQ(node.states().reason(),
            "a second sender: another program sends C-arm commands on CARM_COMMAND, beside this program: stop one");
  EXPECT_TRUE(last.velocity.isZero(0));
  frame();
  const test::Stage fresh;
  const ReplaySummary found = replay<ServoLoop>(log, {}, fresh.settings, fresh.tree);
  EXPECT_EQ(found.first_difference.value_or(""), "");
  EXPECT_EQ(found.equal, k);
  EXPECT_EQ(found.commands, k) << "neither the other's nor the own ones that come round are in the log";
}

// What was recorded and is sent again is no echo.
TEST_F(TwoParties, ItsOwnCommandAgainIsAnothersToo) {
  publish(*bus, kCArmCommandChannel, last);
  frame();
  EXPECT_EQ(node.states().state(), ServoState::kFault);
}

TEST_F(TwoParties, AnothersStatusIsASecondLoop) {
  ServoStatus status;
  status.state = ServoState::kIdle;
  publish(*bus, kServoStatusChannel, status);
  handle();
  node.answer(k * kPeriod_us + 20'000);
  EXPECT_EQ(node.states().state(), ServoState::kFault) << "without a frame in between";
  EXPECT_EQ(node.states().reason(),
            "a second sender: two loops on SERVO_STATUS: this program and another program: stop one");
}

TEST_F(TwoParties, RubbishAndItsOwnLateMessagesAreNobodysCommands) {
  DisturbanceSettings bad;
  bad.reorder_probability = bad.duplicate_probability = 0.5;
  bad.corruption_probability = 0.3;
  bad.reorder_delay_ms = 150;
  side.disturb(kCArmCommandChannel, bad);
  for (int i = 0; i < 10; ++i) {
    bus->publish(kCArmCommandChannel, {1, 2, 3, 4, 5, 6, 7, 8, 9});
    std::vector<std::uint8_t> cut = encode(last);
    cut.resize(cut.size() - 4);
    bus->publish(kCArmCommandChannel, cut);
    frame();
  }
  EXPECT_EQ(node.states().state(), ServoState::kServo);
}

TEST_F(TwoParties, ASessionIsAnnouncedWithEachArming) {
  auto announced = sessions.take();
  ASSERT_EQ(announced.size(), 1u);
  EXPECT_EQ(announced[0].command_sequence, 0);
  Operator person(recorded);
  frame();
  person.ask(ServoRequestKind::kStop, k * kPeriod_us);
  frame();
  EXPECT_TRUE(sessions.take().empty());
  Operator next(recorded);
  frame();
  next.ask(ServoRequestKind::kArm, k * kPeriod_us);
  const std::int64_t before = last.sequence;
  frame();
  ASSERT_EQ(node.states().state(), ServoState::kArmed);
  const auto again = sessions.take();
  ASSERT_EQ(again.size(), 1u);
  EXPECT_EQ(again[0].command_sequence, before);
  EXPECT_NE(again[0].session, announced[0].session);
}

}  // namespace
}  // namespace angio::test
