// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include <limits>

#include "angio/experiments/observers.hpp"
#include "angio/simulation/simulated_carm.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;

// An arm that believes every command however old, and who watches it.
struct Watched {
  CArmLimits limits = CArmLimits::typical();
  ReceiverSettings gullible = [] {
    ReceiverSettings r;
    r.max_command_age_ms = r.max_command_lead_ms = 60e3;
    return r;
  }();
  SimulatedCArm arm{limits, CArmJoints::Zero(), 0, gullible};
  CommandObserver observer{limits, 0.3, 0.3};
  std::int64_t now_us = 0, sequence = 0;

  void send(std::int64_t frame, const CArmJoints& velocity, std::int64_t valid_for_us = 200'000) {
    const CArmCommand command{now_us, ++sequence, frame, valid_for_us, velocity};
    observer.arrived(command, now_us);
    arm.obey(command, now_us);
  }
  void wait(std::int64_t duration_us) {
    for (const std::int64_t until_us = now_us + duration_us; now_us < until_us;) {
      now_us = std::min(now_us + 7'000, until_us);
      arm.advance(now_us);
      observer.see(arm.state());
    }
  }
  std::string breach() const { return observer.breach().value_or(""); }
};

TEST(CommandObserver, HasNothingAgainstSoundCommandsAndGapsBetweenThem) {
  Watched w;
  test::Random random(2);
  for (std::int64_t k = 1; k < 2000; ++k) {
    w.observer.exposed(k, w.now_us, std::nullopt);
    w.wait(80'000);
    CArmJoints wanted;
    for (int i = 0; i < kCArmJointCount; ++i) wanted[i] = random.uniform(-1, 1) * w.limits.velocity[i];
    if (k % 5 == 0) wanted = w.limits.velocity;  // Into the ends of the ranges, too.
    if (k % 7 != 0) w.send(k, wanted, 1 + static_cast<std::int64_t>(random.uniform(0, 400'000)));
    ASSERT_EQ(w.breach(), "") << k;
  }
  EXPECT_EQ(w.observer.unsound(), 0);
}

TEST(CommandObserver, SeesAStaleCommandExecuted) {
  Watched w;
  w.observer.exposed(1, 0, std::nullopt);
  w.wait(350'000);
  w.send(1, 0.1 * w.limits.velocity);
  EXPECT_EQ(w.observer.unsound(), 1);
  EXPECT_EQ(w.breach(), "") << "it has arrived, but nothing has moved yet";
  w.wait(20'000);
  EXPECT_THAT(w.breach(), HasSubstr("350 ms before"));
}

TEST(CommandObserver, SeesACommandByASpoiltFrameOrByNoneExecuted) {
  Watched spoilt;
  spoilt.observer.exposed(1, 0, "another patient's");
  spoilt.send(1, 0.1 * spoilt.limits.velocity);
  spoilt.wait(20'000);
  EXPECT_THAT(spoilt.breach(), HasSubstr("another patient's"));
  Watched invented;
  invented.send(77, 0.1 * invented.limits.velocity);
  invented.wait(20'000);
  EXPECT_THAT(invented.breach(), HasSubstr("no frame"));
}

TEST(CommandObserver, SeesAMachineThatDoesNotStopWhenCommandsDo) {
  Watched w;
  w.observer.exposed(1, 0, std::nullopt);
  w.send(1, 0.2 * w.limits.velocity);
  w.wait(200'000);
  CArmState coasting = w.arm.state();
  for (int i = 0; i < 10; ++i) {
    coasting.time_us += 10'000;
    coasting.joints += 0.01 * coasting.velocity;
    w.observer.see(coasting);
  }
  EXPECT_THAT(w.breach(), HasSubstr("by no command"));
}

// A drive's observer that has seen one frame, and a command to push by it.
struct WatchedDrive {
  CommandObserver observer{CatheterSettings(), 0.35, 0.2};
  CatheterCommand push;
  CatheterState state;

  explicit WatchedDrive(const std::optional<std::string>& spoilt = std::nullopt) {
    observer.exposed(1, 0, spoilt);
    push.frame_sequence = 1;
    push.valid_for_us = 300'000;
    push.insertion_speed_m_per_s = 12e-3;
    observer.see(state);
  }
  void moves(std::int64_t now_us) {
    state.time_us = now_us;
    state.insertion_speed_m_per_s = push.insertion_speed_m_per_s;
    observer.see(state);
  }
  std::string breach() const { return observer.breach().value_or(""); }
};

TEST(CommandObserver, HasNothingAgainstADriveThatObeysAndRests) {
  WatchedDrive w;
  w.observer.sent(w.push, 199'000);
  w.observer.arrived(w.push, 279'000);
  w.moves(290'000);
  w.moves(579'000);
  CatheterCommand rest = w.push;
  rest.insertion_speed_m_per_s = 0;
  w.observer.sent(rest, 5'000'000);  // To stand still is never too late.
  EXPECT_EQ(w.breach(), "");
  EXPECT_EQ(w.observer.unsound(), 0);
}

TEST(CommandObserver, SeesALoopThatTellsADriveToMoveByWhatItMustNot) {
  WatchedDrive late;
  late.observer.sent(late.push, 201'000);
  EXPECT_EQ(late.breach(), "the loop commands motion by a frame of 201 ms before");
  for (const char* wrong : {"frozen", "another patient's", "of a wrong clock", "read with impossible joints"}) {
    WatchedDrive spoilt(wrong);
    spoilt.observer.sent(spoilt.push, 0);
    EXPECT_THAT(spoilt.breach(), HasSubstr(wrong));
  }
  WatchedDrive invented;
  invented.push.frame_sequence = 2;
  invented.observer.sent(invented.push, 0);
  EXPECT_THAT(invented.breach(), HasSubstr("no frame"));
  for (const double speed : {31e-3, -31e-3, std::numeric_limits<double>::quiet_NaN()}) {
    WatchedDrive fast;
    fast.push.insertion_speed_m_per_s = speed;
    fast.observer.sent(fast.push, 0);
    EXPECT_THAT(fast.breach(), HasSubstr("more than the machine's speed"));
  }
}

TEST(CommandObserver, SeesADriveThatMovesByItselfOrByAStaleCommand) {
  WatchedDrive itself;
  itself.moves(10'000);
  EXPECT_THAT(itself.breach(), HasSubstr("axis 0 moved at 0.012 [rad/s, m/s] by no command"));
  WatchedDrive outlasts;
  outlasts.observer.arrived(outlasts.push, 0);
  outlasts.moves(290'000);
  EXPECT_EQ(outlasts.breach(), "");
  outlasts.moves(301'000);  // The command was in force at the interval's beginning.
  outlasts.moves(311'000);
  EXPECT_THAT(outlasts.breach(), HasSubstr("by no command"));
  WatchedDrive stale;
  stale.observer.arrived(stale.push, 351'000);
  EXPECT_EQ(stale.observer.unsound(), 1);
  stale.moves(360'000);
  EXPECT_THAT(stale.breach(), HasSubstr("by a frame of 351 ms before"));
}

TEST(LimitObserver, SeesADriveBeyondItsRangeOrSpeed) {
  const auto breachOf = [](const CatheterState& state) {
    LimitObserver observer{CatheterSettings()};
    observer.see(CatheterState());
    observer.see(state);
    return observer.breach().value_or("");
  };
  CatheterState state;
  state.time_us = 10'000;
  state.insertion_m = 1.5;
  state.insertion_speed_m_per_s = -30e-3;
  state.roll_rad = 1000;
  EXPECT_EQ(breachOf(state), "");
  state.insertion_m = 1.501;
  EXPECT_THAT(breachOf(state), HasSubstr("axis 0: position"));
  state.insertion_m = 0;
  state.bend_rad = -0.01;
  EXPECT_THAT(breachOf(state), HasSubstr("axis 2: position below"));
  state.bend_rad = 0;
  state.roll_speed_rad_per_s = -6.4;
  EXPECT_THAT(breachOf(state), HasSubstr("axis 1: speed"));
}

// A straight way leaves nothing; a table that goes 30 mm beside the box of start and goal, and a target that goes 40 mm
// the wrong way, are seen, and stay seen when the arm is back.
TEST(TrajectoryObserver, SeesHowFarATrajectoryLeavesStartAndGoal) {
  const CArmGeometry carm;
  const auto at = [](double primary_rad, double x, double y, double z) {
    return CArmJoints((CArmJoints() << primary_rad, 0, x, y, z).finished());
  };
  const CArmJoints start = at(0, 0, 0, 0), goal = at(0.5, 0.1, -0.05, 0);
  const Eigen::Vector3d target(-0.1, 0.05, 0);  // At the isocentre when the arm is at its goal.
  TrajectoryObserver observer(carm, start, goal, target);
  for (double share = 0; share <= 1; share += 0.1) observer.see(start + share * (goal - start));
  EXPECT_NEAR(observer.maxTable_m(), 0, 1e-12);
  EXPECT_NEAR(observer.maxTarget_m(), 0, 1e-12);
  observer.see(at(0.2, 0.05, -0.02, 0.03));
  EXPECT_NEAR(observer.table_m(), 0.03, 1e-12);
  EXPECT_LT(observer.target_m(), 0);
  const double scale = 1 + 0.04 / std::hypot(0.1, 0.05);
  observer.see(at(0.3, 0.1 - 0.1 * scale, -0.05 + 0.05 * scale, 0));
  EXPECT_NEAR(observer.target_m(), 0.04, 1e-9);
  observer.see(goal);
  EXPECT_NEAR(observer.table_m(), 0, 1e-12);
  EXPECT_NEAR(observer.maxTarget_m(), 0.04, 1e-9);
  EXPECT_NEAR(observer.maxTable_m(), 0.04, 1e-9);
}

}  // namespace
}  // namespace angio::test
