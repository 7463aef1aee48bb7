// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/types/command_gate.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "angio/messaging/disturbed_bus.hpp"
#include "angio/simulation/nodes.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/types/channels.hpp"

namespace angio::test {
namespace {

using Refusal = CommandGate::Refusal;
constexpr std::int64_t kHuge = std::int64_t{1} << 62, kPeriod_us = 66'667;

// A machine's gate, hearing commands at a given time.
struct Gate {
  CommandGate gate;
  std::int64_t now_us = 1'000'000;

  std::optional<Refusal> hear(std::int64_t sequence, const std::string& sender = "loop", bool stands_still = false) {
    return hear({sequence, now_us, stands_still}, sender);
  }
  std::optional<Refusal> hear(const CommandGate::Command& command, const std::string& sender) {
    const auto refused = gate.refusal(command, sender, now_us);
    if (!refused) gate.obeyed(command, sender, now_us);
    return refused;
  }
};

TEST(CommandGate, LetsOnlyOneSenderMoveTheMachineAndEverybodyStopIt) {
  Gate g;
  EXPECT_EQ(g.hear(5), std::nullopt);
  EXPECT_EQ(g.hear(6, "other"), Refusal::kOtherSender);
  EXPECT_EQ(g.hear(kHuge, "other", true), std::nullopt);
  EXPECT_EQ(g.hear({kHuge, kHuge, true}, "loop"), std::nullopt) << "what stops counts whatever its numbers are";
  EXPECT_EQ(g.hear({-kHuge, -kHuge, true}, ""), std::nullopt);
  g.now_us += kPeriod_us;
  EXPECT_EQ(g.hear(6), std::nullopt) << "and binds nothing";
  EXPECT_EQ(g.gate.sender(g.now_us), "loop");
}

TEST(CommandGate, NoNumberLocksOutThoseThatFollow) {
  for (const std::string sender : {"", "loop"}) {
    Gate g;
    EXPECT_EQ(g.hear(1, sender), std::nullopt);
    for (const std::int64_t far : {std::int64_t{1002}, kHuge, std::numeric_limits<std::int64_t>::max()}) {
      EXPECT_EQ(g.hear(far, sender), Refusal::kJumped) << far;
    }
    EXPECT_EQ(g.hear({2, g.now_us + CommandGate::kMaxTimeJump_us + 1, false}, sender), Refusal::kJumped);
    EXPECT_EQ(g.hear({2, std::numeric_limits<std::int64_t>::max(), false}, sender), Refusal::kJumped);
    EXPECT_EQ(g.hear(1, sender), Refusal::kLate);
    EXPECT_EQ(g.hear(1001, sender), std::nullopt) << "as far as the window reaches";
  }
}

TEST(CommandGate, IsFreeAgainAfterASecondOfSilence) {
  Gate g;
  EXPECT_EQ(g.hear(kHuge, "first"), std::nullopt) << "a machine that nobody moves takes whom it hears";
  g.now_us += CommandGate::kSilence_us;
  EXPECT_EQ(g.hear(1, "second"), Refusal::kOtherSender);
  g.now_us += 1;
  EXPECT_EQ(g.hear(2, "second"), std::nullopt);
  EXPECT_EQ(g.hear(kHuge + 1, "first"), Refusal::kOtherSender);
}

TEST(CommandGate, FollowsAnAnnouncedSessionOnce) {
  Gate g;
  EXPECT_EQ(g.hear(kHuge, "first"), std::nullopt);
  const ServoSession session{g.now_us, 1, 77, 40};
  g.gate.begin(session, "second", g.now_us);
  EXPECT_EQ(g.hear(41, "first"), Refusal::kOtherSender);
  EXPECT_EQ(g.hear(40, "second"), Refusal::kLate);
  EXPECT_EQ(g.hear(41, "second"), std::nullopt);
  g.gate.begin(session, "third", g.now_us);
  EXPECT_EQ(g.hear(42, "third"), Refusal::kOtherSender) << "an announcement that was recorded counts for nothing";
  EXPECT_EQ(g.hear(42, "second"), std::nullopt);
}

// A bus on which two parties speak, with one machine of each kind.
struct TwoMachines : testing::Test {
  void handle() {
    while (bus->handle(std::chrono::milliseconds(0)) > 0) continue;
    arm.listen(now_us);
    drive.listen(now_us);
  }
  void say(std::int64_t sequence, double speed) {
    CArmCommand turn{now_us, sequence, sequence, 500'000, CArmJoints::Zero()};
    turn.velocity[0] = speed * limits.velocity[0];
    publish(*bus, kCArmCommandChannel, turn);
    CatheterCommand push;
    push.time_us = now_us;
    push.sequence = push.frame_sequence = sequence;
    push.valid_for_us = 500'000;
    push.insertion_speed_m_per_s = 5e-3 * speed;
    publish(*bus, kCatheterCommandChannel, push);
    handle();
  }
  // Whether both machines, or none, move now.
  bool move() {
    now_us += 300'000;
    arm.report(now_us);
    drive.report(now_us);
    const bool turns = arm.arm().state().velocity[0] != 0,
               pushes = drive.catheter().state().insertion_speed_m_per_s != 0;
    EXPECT_EQ(turns, pushes);
    return turns;
  }

  CArmLimits limits = CArmLimits::typical();
  VesselTree tree = branchingTree(6);
  std::unique_ptr<Bus> bus = openBus("memq://");
  std::int64_t now_us = 0;
  lab::SimulatedCArmNode arm{*bus, limits, CArmJoints::Zero(), 0};
  lab::SimulatedCatheterNode drive{*bus, tree, {}, {0, 0.01}, 0};
};

TEST_F(TwoMachines, ObeyAStopAfterNumbersThatAreFarAhead) {
  say(7, 0.1);
  EXPECT_TRUE(move());
  say(kHuge, 0.2);
  say(8, 0);
  EXPECT_FALSE(move()) << "a forged number must not outrank the loop's stop";
  say(9, 0.1);
  EXPECT_TRUE(move());
  say(3, 0);
  EXPECT_FALSE(move()) << "nor must a number be needed to stop";
  EXPECT_EQ(arm.arm().ignored().jumped, 1);
  EXPECT_EQ(drive.catheter().ignored().jumped, 1);
  for (auto news : {arm.takeNews(), drive.takeNews()}) {
    ASSERT_TRUE(news);
    EXPECT_EQ(*news, "a command with sequence 4611686018427387904 is not obeyed: too far ahead of the last one");
  }
  EXPECT_FALSE(arm.takeNews() || drive.takeNews()) << "each cause once";
}

TEST_F(TwoMachines, ObeyASessionWhereverItsNumbersBegin) {
  say(kHuge, 0.1);
  EXPECT_TRUE(move());
  say(1, 0.1);
  publish(*bus, kServoSessionChannel, ServoSession{now_us, 1, 5, 0});
  publish(*bus, kCatheterSessionChannel, ServoSession{now_us, 1, 5, 0});
  handle();
  say(1, 0);
  EXPECT_FALSE(move());
  say(2, 0.1);
  EXPECT_TRUE(move());
}

}  // namespace
}  // namespace angio::test
