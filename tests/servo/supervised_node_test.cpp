// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/supervised_node.hpp"

#include <gtest/gtest.h>

#include "angio/messaging/recording_bus.hpp"
#include "angio/servo/operator.hpp"
#include "angio/servo/replay.hpp"
#include "angio/test/temporary_folder.hpp"
#include "stage.hpp"

namespace angio {
namespace {

constexpr std::int64_t kPeriod_us = 66'667;

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
  SupervisedServoNode node{recorded, stage.settings, {}, stage.tree};
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

TEST_F(SupervisedRun, IsReplayedBitForBitWithWhatItsSupervisorTookBack) {
  ask(ServoRequestKind::kArm);
  ask(ServoRequestKind::kStart);
  for (int i = 0; i < 6; ++i) frame();
  ask(ServoRequestKind::kStop);
  for (int i = 0; i < 2; ++i) frame();
  const test::Stage fresh;
  const ReplaySummary found = replay(log, fresh.settings, fresh.tree);
  EXPECT_EQ(found.first_difference.value_or(""), "");
  EXPECT_EQ(found.equal, found.commands);
  EXPECT_GT(found.held, 2);
  EXPECT_LT(found.held, found.answered);
}

}  // namespace
}  // namespace angio
