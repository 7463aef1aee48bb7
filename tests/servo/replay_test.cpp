// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/replay.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include "angio/base/errors.hpp"
#include "angio/messaging/log_reader.hpp"
#include "angio/messaging/recording_bus.hpp"
#include "angio/servo/servo_node.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/types/channels.hpp"
#include "stage.hpp"

namespace angio::test {
namespace {

constexpr std::chrono::milliseconds kNoWait(0);

// A live loop that is too slow for its X-ray: of five frames it answers three, and joints come while it works.
struct LiveRun : testing::Test {
  void SetUp() override {
    const auto bus = openBus("memq://");
    RecordingBus recorded(*bus, log);
    ServoNode node(recorded, test::moving(stage.settings), stage.tree);
    test::start(*bus, node);
    CArmState turning = stage.state(1);
    const auto say = [&](std::int64_t time_us) {  // Not at the frames' own times, so that joints are interpolated.
      turning.time_us = time_us;
      ++turning.sequence;
      turning.joints[0] += 1e-3;
      publish(*bus, kCArmStateChannel, turning);
    };
    for (const std::int64_t frame : {1, 2, 3, 4, 5}) {
      say(frame * 66'667 - 20'000);
      publish(*bus, kXrayFrameChannel, stage.frame(frame));
      if (frame % 2 == 1) say(frame * 66'667 + 20'000);
      if (frame == 2 || frame == 4) continue;  // Still at work: the next one comes on top of it.
      while (bus->handle(kNoWait) > 0) continue;
      ASSERT_TRUE(node.answer(frame * 66'667));
    }
  }

  /// The events of the log in another order, those that `keep` wants, as another logger might have heard them.
  std::string rewritten(const std::function<bool(const LogEvent&)>& keep, bool inputs_last) {
    const std::string path = folder.path("rewritten.lcm");
    const auto out = openBus("file://" + path + "?mode=w");
    for (const bool late : {false, true}) {
      LogReader in(log);
      for (auto event = in.next(); event; event = in.next()) {
        const bool input = event->channel == kServoInputChannel || event->channel == kCArmCommandChannel;
        if (keep(*event) && (inputs_last && input) == late) out->publish(event->channel, event->bytes);
      }
    }
    return path;
  }

  test::Stage stage;
  test::TemporaryFolder folder;
  std::string log = folder.path("live.lcm");
};

using Replay = LiveRun;

TEST_F(Replay, GivesTheLiveCommandsBitForBit) {
  int moving = 0;
  const auto count = [&](const ReplayedFrame<ServoLoop>& f) { moving += !f.report.command.velocity.isZero(0); };
  const ReplaySummary summary = replay<ServoLoop>(log, count, stage.settings, stage.tree);
  EXPECT_EQ(summary.frames, 5);
  EXPECT_EQ(summary.answered, 3);
  EXPECT_EQ(summary.equal, 3);
  EXPECT_EQ(summary.commands, 3);
  EXPECT_EQ(moving, 3) << "commands that stand still would be equal too easily";
  EXPECT_TRUE(summary.knew_inputs);
  EXPECT_EQ(summary.first_difference, std::nullopt);
}

TEST_F(Replay, DoesNotDependOnWhatALoggerHeardFirst) {
  const std::string other = rewritten([](const LogEvent&) { return true; }, true);
  const ReplaySummary summary = replay<ServoLoop>(other, {}, stage.settings, stage.tree);
  EXPECT_EQ(summary.equal, 3);
  EXPECT_EQ(summary.first_difference, std::nullopt);
}

TEST_F(Replay, NamesTheFirstDifference) {
  ServoLoopSettings other = stage.settings;
  other.T_dsa_cb.translation().x() += 1e-6;  // A micrometre.
  const ReplaySummary summary = replay<ServoLoop>(log, {}, other, stage.tree);
  EXPECT_LT(summary.equal, 3);
  ASSERT_TRUE(summary.first_difference);
  EXPECT_THAT(*summary.first_difference, testing::HasSubstr("frame 1: joint_velocity["));

  int frames = 0;
  const std::string without =
      rewritten([&](const LogEvent& e) { return e.channel != kXrayFrameChannel || ++frames != 3; }, false);
  const ReplaySummary lacking = replay<ServoLoop>(without, {}, stage.settings, stage.tree);
  ASSERT_TRUE(lacking.first_difference);
  EXPECT_THAT(*lacking.first_difference, testing::HasSubstr("frame 3 was answered, and is not in the log"));
}

TEST_F(Replay, ARunWithoutALoopIsAnsweredToo) {
  const std::string bare = rewritten(
      [](const LogEvent& e) { return e.channel == kXrayFrameChannel || e.channel == kCArmStateChannel; }, false);
  const ReplaySummary summary = replay<ServoLoop>(bare, {}, stage.settings, stage.tree);
  EXPECT_FALSE(summary.knew_inputs);
  EXPECT_EQ(summary.answered, 5);
  EXPECT_EQ(summary.commands, 0);
}

TEST_F(Replay, ALogWithoutFramesIsRefusedByName) {
  const std::string bare = rewritten([](const LogEvent& e) { return e.channel == kServoInputChannel; }, false);
  try {
    replay<ServoLoop>(bare, {}, stage.settings, stage.tree);
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("rewritten.lcm: holds no X-ray frame"));
  }
}

}  // namespace
}  // namespace angio::test
