// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_state_machine.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include <array>

#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"
#include "frame_period.hpp"

namespace angio::test {
namespace {

using State = ServoState;
using Kind = ServoRequestKind;
using RejectionKind = ServoStateMachine::RejectionKind;

TEST(ServoStateTable, EveryPairOfStateAndEvent) {
  // Columns: stop, arm, start, reset, emergency stop, accepted, rejected, fault.
  using Row = std::array<State, kServoEventCount>;
  const State I = State::kIdle, A = State::kArmed, H = State::kHold, S = State::kServo, F = State::kFault,
              E = State::kEmergencyStop;
  const std::pair<State, Row> rows[] = {
      {I, {I, A, I, I, E, I, I, I}}, {A, {I, A, H, A, E, A, A, F}}, {H, {I, H, H, H, E, S, H, F}},
      {S, {I, S, S, S, E, S, H, F}}, {F, {F, F, F, I, E, F, F, F}}, {E, {E, E, E, I, E, E, E, E}},
  };
  ASSERT_EQ(std::size(rows), static_cast<std::size_t>(kServoStateCount));
  for (const auto& [from, row] : rows) {
    for (int event = 0; event < kServoEventCount; ++event) {
      EXPECT_EQ(stateAfter(from, static_cast<ServoEvent>(event)), row[static_cast<std::size_t>(event)])
          << nameOf(from) << ", event " << event;
    }
  }
}

// A machine with an operator who sees each status at once.
class ServoStates : public testing::Test {
 protected:
  ServoRequest asked(Kind kind) {
    ServoRequest r;
    r.sequence = ++sequence_;
    r.time_us = 1000 * sequence_;
    r.status_time_us = frame_us_;
    r.transitions = machine_.transitions();
    r.request = kind;
    return r;
  }
  std::optional<std::string> request(Kind kind) { return machine_.request(asked(kind), frame_us_, now_us_); }
  void next() {
    now_us_ += kPeriod_us;
    frame_us_ = now_us_ + 5'000'000;  // The X-ray's clock is another one.
  }
  void accept(int frames = 1) {
    for (int i = 0; i < frames; ++i) {
      next();
      machine_.accept(now_us_);
    }
  }
  void reject(int frames = 1, RejectionKind kind = RejectionKind::kUnseen) {
    for (int i = 0; i < frames; ++i) {
      next();
      machine_.reject(kind, "dark", now_us_);
    }
  }
  void start() {
    EXPECT_EQ(request(Kind::kArm), std::nullopt);
    EXPECT_EQ(request(Kind::kStart), std::nullopt);
    accept(settings_.frames_to_start);
    EXPECT_TRUE(machine_.moves());
  }
  State state() const { return machine_.state(); }

  ServoStateSettings settings_;
  ServoStateMachine machine_{settings_};
  std::int64_t now_us_ = 1'000'000, frame_us_ = 0, sequence_ = 0;
};

TEST_F(ServoStates, BeginsIdleAndTrustedFramesAloneMoveNothing) {
  EXPECT_EQ(state(), State::kIdle);
  accept(10);
  EXPECT_EQ(state(), State::kIdle);
  request(Kind::kArm);
  accept(10);
  EXPECT_EQ(state(), State::kArmed);
  EXPECT_EQ(machine_.transitions(), 1);
}

TEST_F(ServoStates, MovesAfterAsManyTrustedFramesInARowAsTheGuardWants) {
  request(Kind::kArm);
  request(Kind::kStart);
  accept(settings_.frames_to_start - 1);
  EXPECT_EQ(state(), State::kHold);
  reject();
  accept(settings_.frames_to_start - 1);
  EXPECT_EQ(state(), State::kHold) << "a doubt must start the count again";
  EXPECT_NE(machine_.reason(), "");
  accept();
  EXPECT_EQ(state(), State::kServo);
  EXPECT_EQ(machine_.reason(), "");
}

TEST_F(ServoStates, HoldsOnADoubtAndResumesByItself) {
  start();
  reject();
  EXPECT_EQ(state(), State::kHold);
  EXPECT_EQ(machine_.reason(), "dark");
  EXPECT_EQ(machine_.log().back().cause, ServoCause::kFrameDoubted);
  reject(100);  // Seeing nothing, however long, is no fault.
  EXPECT_EQ(state(), State::kHold);
  accept(settings_.frames_to_resume);
  EXPECT_EQ(state(), State::kServo);
}

TEST_F(ServoStates, AContradictionThatLastsIsAFault) {
  start();
  const int frames = static_cast<int>(1e3 * settings_.max_contradiction_ms / kPeriod_us);
  reject(frames, RejectionKind::kContradiction);
  EXPECT_EQ(state(), State::kHold);
  reject(2, RejectionKind::kContradiction);
  EXPECT_EQ(state(), State::kFault);
  EXPECT_EQ(machine_.log().back().cause, ServoCause::kViewDisagrees);
}

TEST_F(ServoStates, SilenceHoldsAndThenIsAFault) {
  start();
  now_us_ += 240'000;
  machine_.wait(now_us_);
  EXPECT_TRUE(machine_.moves());
  now_us_ += 20'000;
  machine_.wait(now_us_);
  EXPECT_EQ(state(), State::kHold);
  EXPECT_EQ(machine_.log().back().cause, ServoCause::kFramesLate);
  now_us_ += 2'000'000;
  machine_.wait(now_us_);
  EXPECT_EQ(state(), State::kFault);
  EXPECT_EQ(machine_.log().back().cause, ServoCause::kFramesGone);
}

TEST_F(ServoStates, AFrameAfterALongSilenceDoesNotHideIt) {
  start();
  now_us_ += 3'000'000;  // Nobody called wait().
  machine_.accept(now_us_);
  EXPECT_EQ(state(), State::kFault);
}

TEST_F(ServoStates, SilenceBeforeTheFirstFrameIsAFaultOnceStarted) {
  request(Kind::kArm);
  machine_.wait(now_us_ += 60'000'000);
  EXPECT_EQ(state(), State::kArmed) << "X-rays may be off until the start";
  request(Kind::kStart);
  machine_.wait(now_us_ += 2'100'000);
  EXPECT_EQ(state(), State::kFault);
}

TEST_F(ServoStates, FaultsAreLatchedAndNeedResetArmAndStart) {
  start();
  machine_.fault(ServoCause::kJointLimitBroken, "primary at 3", now_us_);
  EXPECT_EQ(state(), State::kFault);
  accept(10);
  for (const Kind kind : {Kind::kArm, Kind::kStart}) {
    EXPECT_NE(request(kind), std::nullopt);
    EXPECT_EQ(state(), State::kFault);
  }
  EXPECT_EQ(request(Kind::kReset), std::nullopt);
  EXPECT_EQ(state(), State::kIdle);
  EXPECT_NE(request(Kind::kStart), std::nullopt) << "started without being armed";
  start();
}

TEST_F(ServoStates, EmergencyStopWorksFromEveryStateAndIsLatched) {
  for (int begun = 0; begun < 5; ++begun) {
    if (begun >= 1) request(Kind::kArm);
    if (begun >= 2) request(Kind::kStart);
    if (begun >= 3) accept(settings_.frames_to_start);
    if (begun >= 4) machine_.fault(ServoCause::kMotionDisagrees, "", now_us_);
    // It counts even when it is old, doubled, and answers another state.
    ServoRequest stop;
    stop.request = Kind::kEmergencyStop;
    stop.transitions = 12345;
    EXPECT_EQ(machine_.request(stop, frame_us_, now_us_), std::nullopt);
    EXPECT_EQ(state(), State::kEmergencyStop) << begun;
    for (const Kind kind : {Kind::kArm, Kind::kStart, Kind::kStop}) request(kind);
    accept(5);
    EXPECT_EQ(state(), State::kEmergencyStop);
    EXPECT_EQ(request(Kind::kReset), std::nullopt);
    EXPECT_EQ(state(), State::kIdle);
  }
}

TEST_F(ServoStates, DoubledLateAndOvertakenRequestsNeverArm) {
  const ServoRequest arm = asked(Kind::kArm);
  machine_.request(arm, frame_us_, now_us_);
  request(Kind::kStop);
  EXPECT_EQ(state(), State::kIdle);
  EXPECT_NE(machine_.request(arm, frame_us_, now_us_), std::nullopt) << "doubled";
  EXPECT_EQ(state(), State::kIdle);

  const ServoRequest overtaken = asked(Kind::kArm);
  request(Kind::kStop);
  EXPECT_NE(machine_.request(overtaken, frame_us_, now_us_), std::nullopt) << "behind the stop that came after it";

  const ServoRequest late = asked(Kind::kArm);
  accept(40);  // 2.7 s of frames go by.
  EXPECT_NE(machine_.request(late, frame_us_, now_us_), std::nullopt);
  EXPECT_EQ(state(), State::kIdle);

  ServoRequest elsewhere = asked(Kind::kArm);
  elsewhere.transitions -= 1;
  EXPECT_NE(machine_.request(elsewhere, frame_us_, now_us_), std::nullopt) << "asked in another state";
  EXPECT_EQ(state(), State::kIdle);
}

TEST_F(ServoStates, HearsAnOperatorWhoseProgramStartedAgain) {
  accept(5);
  request(Kind::kArm);
  request(Kind::kStop);
  ServoRequest again = asked(Kind::kArm);
  again.sequence = 1;
  EXPECT_EQ(machine_.request(again, frame_us_, now_us_), std::nullopt);
  EXPECT_EQ(state(), State::kArmed);
}

TEST_F(ServoStates, AClockThatRunsBackIsAFault) {
  start();
  machine_.accept(now_us_ - 1);
  EXPECT_EQ(state(), State::kFault);
  EXPECT_EQ(machine_.log().back().cause, ServoCause::kClockJumped);
}

TEST_F(ServoStates, EveryChangeIsLoggedWithItsCauseAndTheLogIsBounded) {
  start();
  for (int i = 0; i < 500; ++i) {
    reject();
    accept(settings_.frames_to_resume);
  }
  EXPECT_EQ(machine_.transitions(), 3 + 1000);
  EXPECT_EQ(machine_.log().size(), 256u);
  for (std::size_t i = 1; i < machine_.log().size(); ++i) {
    const auto &a = machine_.log()[i - 1], &b = machine_.log()[i];
    EXPECT_EQ(a.to, b.from);
    EXPECT_LE(a.time_us, b.time_us);
    EXPECT_NE(b.from, b.to);
    EXPECT_NE(b.cause, ServoCause::kNone);
    EXPECT_NE(b.reason, "");
  }
}

// Whatever comes in whatever order: it moves only after arm and start, and only on a trusted frame.
TEST_F(ServoStates, NoSequenceOfInputsMovesWithoutArmStartAndTrust) {
  test::Random random(4);
  int moved = 0;
  for (int run = 0; run < 300; ++run) {
    ServoStateMachine machine(settings_);
    std::int64_t now_us = 1, transitions_at_arm = -1;
    bool started = false;
    int in_a_row = 0;
    for (int i = 0; i < 200; ++i) {
      now_us += static_cast<std::int64_t>(random.uniform(0, 100'000));
      const int input = static_cast<int>(random.uniform(0, 24));
      const State before = machine.state();
      if (input < 5) {
        ServoRequest r;
        r.sequence = i;
        r.transitions = machine.transitions();
        r.request = static_cast<Kind>(input);
        machine.request(r, 0, now_us);
        if (r.request == Kind::kArm && before == State::kIdle) transitions_at_arm = machine.transitions();
        if (r.request == Kind::kStart && before == State::kArmed) started = transitions_at_arm == r.transitions;
      } else if (input < 20) {
        machine.accept(now_us);
        ++in_a_row;
      } else if (input < 22) {
        machine.reject(input == 20 ? RejectionKind::kUnseen : RejectionKind::kContradiction, "x", now_us);
        in_a_row = 0;
      } else if (input == 22) {
        machine.wait(now_us);
      } else {
        machine.fault(ServoCause::kJointsNotFinite, "x", now_us);
        in_a_row = 0;
      }
      if (machine.state() == State::kIdle || machine.state() == State::kFault) started = false;
      if (machine.moves() && before != State::kServo) {
        EXPECT_TRUE(started);
        EXPECT_GE(in_a_row, settings_.frames_to_resume);
        ++moved;
      }
    }
  }
  EXPECT_GT(moved, 100);
}

TEST(ServoStateSettings, AreChecked) {
  ServoStateSettings settings;
  settings.frames_to_start = 0;
  EXPECT_NE(test::refusalOf([&] { ServoStateMachine{settings}; }).find("frames_to_start"), std::string::npos);
}

}  // namespace
}  // namespace angio::test
