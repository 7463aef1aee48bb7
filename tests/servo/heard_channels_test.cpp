// SPDX-License-Identifier: GPL-2.0-or-later
// What a node says of whom when something is wrong on its bus.
#include "angio/servo/heard_channels.hpp"

#include <gmock/gmock.h>

#include "angio/servo/servo_node.hpp"
#include "angio/test/named_bus.hpp"
#include "angio/test/namespace.hpp"
#include "angio/types/channels.hpp"
#include "stage.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

const std::string kXrayAddress = "10.0.0.1:40001", kArmAddress = "10.0.0.2:40002";

// A C-arm's node, and the last status that it said, as an operator hears it.
struct HeardChannels : testing::Test {
  // One frame's time, in which each message came that `say` said.
  template <typename Say>
  void step(const Say& say) {
    ++k;
    say();
    handle();
    node.answer(now_us());
    handle();
  }
  void handle() {
    while (bus.handle(std::chrono::milliseconds(0)) > 0) continue;
  }
  std::int64_t now_us() const { return k * kPeriod_us; }
  void sayState() { bus.another(kArmAddress, kCArmStateChannel, encode(stage.state(k))); }
  void sayFrame(std::vector<std::uint8_t> bytes) { bus.another(kXrayAddress, kXrayFrameChannel, std::move(bytes)); }
  void ask(ServoRequestKind kind) {
    person.ask(kind, now_us());
    handle();
    node.answer(now_us());
    handle();
  }
  std::string said() const { return statuses.peek() ? statuses.peek()->reason : ""; }
  ServoState state() const { return statuses.peek() ? statuses.peek()->state : ServoState::kIdle; }

  Stage stage;
  NamedBus bus;
  LatestMessage<ServoStatus> statuses{bus, kServoStatusChannel};
  Operator person{bus};
  ServoNode node{bus, stage.settings, stage.tree};
  std::int64_t k = 0;
};

TEST_F(HeardChannels, FramesThatCannotBeDecodedAreNotGone) {
  const auto cut = [&] {
    auto bytes = encode(stage.frame(k));
    bytes.resize(bytes.size() / 2);
    return bytes;
  };
  const auto odd = [&] {
    auto bytes = encode(stage.frame(k));
    bytes.at(8 + 16 + 8) = 12;  // Bits of a pixel, behind fingerprint, time, number and size.
    return bytes;
  };
  const auto another = [&] { return encode(stage.state(k)); };
  const std::pair<std::function<std::vector<std::uint8_t>()>, std::string> cases[] = {
      {cut, "xray_frame_t: "},
      {odd, "xray_frame_t: bits"},
      {another, "xray_frame_t: another type's fingerprint, carm_state_t's"}};
  for (const auto& one : cases) {
    const auto& [wrong_frame, why] = one;
    const auto& wrong = wrong_frame;  // A lambda of C++17 takes no structured binding.
    for (int i = 0; i < 20; ++i) {
      step([&] {
        sayState();
        sayFrame(wrong());
      });
    }
    EXPECT_EQ(state(), ServoState::kIdle);
    EXPECT_THAT(said(), HasSubstr("; ")) << "an operator hears of it before anything is armed";
    EXPECT_THAT(said(), HasSubstr(" messages on XRAY_FRAME from " + kXrayAddress + " cannot be decoded: " + why));
    ask(ServoRequestKind::kArm);
    ask(ServoRequestKind::kStart);
    ASSERT_EQ(state(), ServoState::kHold);
    for (int i = 0; i < 40; ++i) {
      step([&] {
        sayState();
        sayFrame(wrong());
      });
    }
    EXPECT_EQ(state(), ServoState::kFault);
    EXPECT_EQ(node.states().log().back().cause, ServoCause::kFramesGone);
    EXPECT_THAT(said(), StartsWith("no frame can be used: "));
    EXPECT_THAT(said(), HasSubstr(" messages on XRAY_FRAME from " + kXrayAddress + " cannot be decoded: " + why));
    EXPECT_TRUE(node.trouble());
    ask(ServoRequestKind::kReset);
    for (int i = 0; i < 3; ++i) {
      step([&] {
        sayState();
        sayFrame(encode(stage.frame(k)));
      });
    }
    EXPECT_FALSE(node.trouble()) << *node.trouble();
    EXPECT_EQ(said(), "reset was requested");
  }
}

TEST_F(HeardChannels, StatesThatCannotBeDecodedAreNamed) {
  const auto rubbish = [&] { bus.another(kArmAddress, kCArmStateChannel, std::vector<std::uint8_t>(104, 1)); };
  for (int i = 0; i < 20; ++i) {
    step([&] {
      rubbish();
      sayFrame(encode(stage.frame(k)));
    });
  }
  const std::string named = " messages on CARM_STATE from " + kArmAddress + " cannot be decoded: carm_state_t: ";
  EXPECT_THAT(said(), HasSubstr("frames come from " + kXrayAddress + ", but "));
  EXPECT_THAT(said(), HasSubstr(named));
  // When the arm has been heard once, frames are answered, and held.
  step([&] {
    sayState();
    sayFrame(encode(stage.frame(k)));
  });
  EXPECT_FALSE(node.trouble());
  ask(ServoRequestKind::kArm);
  ask(ServoRequestKind::kStart);
  for (int i = 0; i < 5; ++i) {
    step([&] {
      rubbish();
      sayFrame(encode(stage.frame(k)));
    });
  }
  EXPECT_EQ(state(), ServoState::kHold);
  EXPECT_THAT(said(), HasSubstr(named));
}

TEST_F(HeardChannels, SilenceIsToldByWhatWasHeardInstead) {
  for (int i = 0; i < 20; ++i) step([] {});
  EXPECT_EQ(said(), "idle; nothing has come on XRAY_FRAME");
  for (int i = 0; i < 20; ++i) step([&] { sayFrame(encode(stage.frame(k))); });
  EXPECT_EQ(said(), "idle; frames come from " + kXrayAddress + ", but nothing has come on CARM_STATE");
  XrayFrame frame = stage.frame(k);
  for (int i = 0; i < 20; ++i) {
    step([&] {
      sayState();
      frame.time_us += kPeriod_us;  // Its number stays as it is.
      sayFrame(encode(frame));
    });
  }
  EXPECT_THAT(said(), HasSubstr(" messages on XRAY_FRAME from " + kXrayAddress + " came twice or late"));
  for (int i = 0; i < 20; ++i) {
    step([&] {
      sayState();
      sayFrame(encode(stage.frame(k)));
    });
  }
  EXPECT_EQ(said(), "idle");
  for (int i = 0; i < 40; ++i) step([&] { sayState(); });
  EXPECT_EQ(said(), "idle; nothing more has come on XRAY_FRAME, the last from " + kXrayAddress);
}

TEST_F(HeardChannels, TwoMachinesAreCalledThatBeforeTheirClocksAre) {
  const std::string other = "10.0.0.3:40003";
  const auto both = [&] {
    sayState();
    CArmState second = stage.state(k);
    second.time_us -= 108;  // One clock, read at another moment.
    second.sequence += 1000;
    bus.another(other, kCArmStateChannel, encode(second));
    sayFrame(encode(stage.frame(k)));
  };
  const std::string named = "two C-arms on CARM_STATE: " + kArmAddress + " and " + other + ": stop one";
  for (int i = 0; i < 3; ++i) step(both);
  EXPECT_EQ(node.trouble().value_or(""), named);
  EXPECT_THAT(said(), HasSubstr(named)) << "before anything is armed";
  ask(ServoRequestKind::kArm);
  step(both);
  EXPECT_EQ(state(), ServoState::kFault);
  EXPECT_EQ(said(), "a second sender: " + named);
  bus.another(other, kCArmStateChannel, encode(stage.state(k)));
  sayState();
  sayFrame(encode(stage.frame(++k)));
  handle();
  const auto report = node.answer(now_us());
  ASSERT_TRUE(report);
  EXPECT_THAT(report->hold_reason.value_or(""), HasSubstr(named));
}

// Frames that come less often than every 150 ms: one that takes over may be the only one.
TEST_F(HeardChannels, ASlowXrayThatTakesOverIsNoClockThatJumps) {
  const auto slowly = [&](const std::string& sender, std::int64_t clock_us) {
    for (int i = 0; i < 3; ++i) step([&] { sayState(); });
    step([&] {
      sayState();
      XrayFrame frame = stage.frame(k);
      frame.time_us += clock_us;
      bus.another(sender, kXrayFrameChannel, encode(frame));
    });
  };
  slowly(kXrayAddress, 0);
  ask(ServoRequestKind::kArm);
  slowly(kXrayAddress, 0);
  ASSERT_EQ(state(), ServoState::kArmed) << said();
  slowly("10.0.0.3:40003", 1'700'000);
  EXPECT_EQ(state(), ServoState::kFault);
  EXPECT_EQ(said(), "a second sender: two X-rays on XRAY_FRAME, or one that was started again: " + kXrayAddress +
                        " and now 10.0.0.3:40003: stop one, and reset");
  slowly(kXrayAddress, 0);
  EXPECT_EQ(node.trouble().value_or(""), "two X-rays on XRAY_FRAME: " + kXrayAddress + " and 10.0.0.3:40003: stop one");
}

TEST_F(HeardChannels, ClocksOfOtherEpochsAreCalledThat) {
  constexpr std::int64_t kSince1970_us = 1'763'938'257'000'000;
  ++k;
  XrayFrame frame = stage.frame(k);
  frame.time_us += kSince1970_us;
  sayState();
  sayFrame(encode(frame));
  handle();
  auto report = node.answer(now_us());
  ASSERT_TRUE(report);
  const std::string of = "the clocks of XRAY_FRAME from " + kXrayAddress + " and CARM_STATE from " + kArmAddress +
                         " count from different epochs: utime ";
  EXPECT_EQ(report->hold_reason.value_or(""),
            of + "1763938257066667 us (since 1970) and 66667 us (1.85e-05 h): set both to one clock");
  // The other way round, and heard by a node of its own.
  NamedBus second_bus;
  ServoNode second(second_bus, stage.settings, stage.tree);
  CArmState arm = stage.state(k);
  arm.time_us += kSince1970_us;
  second_bus.another(kArmAddress, kCArmStateChannel, encode(arm));
  second_bus.another(kXrayAddress, kXrayFrameChannel, encode(stage.frame(k)));
  second_bus.handle(std::chrono::milliseconds(0));
  report = second.answer(now_us());
  ASSERT_TRUE(report);
  EXPECT_EQ(report->hold_reason.value_or(""),
            of + "66667 us (1.85e-05 h) and 1763938257066667 us (since 1970): set both to one clock");
}

TEST_F(HeardChannels, AClockThatChangesItsEpochSaysSo) {
  ask(ServoRequestKind::kArm);
  step([&] {
    sayState();
    sayFrame(encode(stage.frame(k)));
  });
  step([&] {
    sayState();
    XrayFrame frame = stage.frame(k);
    frame.time_us += 1'763'938'257'000'000;
    sayFrame(encode(frame));
  });
  EXPECT_EQ(state(), ServoState::kFault);
  EXPECT_EQ(said(), "a clock jumped: the clock of XRAY_FRAME from " + kXrayAddress +
                        " counts from another epoch than before: utime 1763938257133334 us (since 1970) after 66667 us "
                        "(1.85e-05 h)");
}

// Between two frames a status' number and time stay; an operator has to hear of each change.
TEST_F(HeardChannels, AnOperatorHearsEachStateWithoutAFrame) {
  ask(ServoRequestKind::kArm);
  EXPECT_EQ(state(), ServoState::kArmed);
  ask(ServoRequestKind::kStart);
  EXPECT_EQ(state(), ServoState::kHold);
  ask(ServoRequestKind::kStop);
  EXPECT_EQ(state(), ServoState::kIdle);
}

}  // namespace
}  // namespace angio::test
