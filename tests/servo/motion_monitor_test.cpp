// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/motion_monitor.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include <functional>

#include "angio/robot/carm_motion_limiter.hpp"
#include "angio/simulation/simulated_carm.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kFrame_us = 66'667;

CArmCommand command(std::int64_t sequence, std::int64_t time_us, const CArmJoints& velocity) {
  return {time_us, sequence, sequence, 200'000, velocity};
}

// A sound arm under commands that come `latency_us` after their frames, and encoders with noise; watched.
struct Watched {
  CArmLimits limits = CArmLimits::typical();
  SimulatedCArm arm{limits, CArmJoints::Zero(), 0};
  CArmMotionLimiter limiter{limits, 0.2};
  MotionMonitor monitor{MotionMonitorSettings(), limits};
  test::Random random{7};
  std::int64_t now_us = 0, frame = 0;
  CArmJoints last = CArmJoints::Zero();

  // One frame: the wish is limited as the loop does it. `between` sees what the encoders say before the monitor does.
  std::optional<std::string> step(const CArmJoints& wanted, std::int64_t latency_us,
                                  const std::function<void(CArmState&)>& between = {}, bool lost = false) {
    last = limiter.limit(wanted, arm.state().joints, 1e-6 * static_cast<double>(latency_us), 1e-6 * kFrame_us);
    const CArmCommand sent = command(++frame, now_us, last);
    monitor.commanded(sent);
    arm.advance(now_us + latency_us);
    if (!lost) arm.obey(sent, now_us + latency_us);
    now_us += kFrame_us;
    arm.advance(now_us);
    CArmState state = arm.state();
    for (int i = 0; i < kCArmJointCount; ++i) state.joints[i] += (i < 2 ? 2e-4 : 5e-5) * random.normal();
    if (between) between(state);
    return monitor.measured(state);
  }
};

TEST(MotionMonitor, LetsASoundArmDoWhatItIsTold) {
  for (const std::int64_t latency_us : {0, 30'000, 60'000}) {
    Watched w;
    test::Random random(5);
    CArmJoints wanted = CArmJoints::Zero();
    for (int k = 0; k < 3000; ++k) {  // 200 s: ramps, reversals, and long ways into the ends of every range.
      if (k % 25 == 0) {
        for (int i = 0; i < kCArmJointCount; ++i) wanted[i] = random.uniform(-1.5, 1.5) * w.limits.velocity[i];
      }
      if (k % 600 > 400) wanted = w.limits.velocity;
      const auto fault = w.step(wanted, latency_us);
      ASSERT_FALSE(fault) << *fault << " at frame " << k << ", latency " << latency_us;
    }
  }
}

TEST(MotionMonitor, BearsCommandsThatAreLost) {
  Watched w;
  CArmJoints wanted = CArmJoints::Zero();
  for (int k = 0; k < 2000; ++k) {
    if (k % 20 == 0) {
      for (int i = 0; i < kCArmJointCount; ++i) wanted[i] = w.random.uniform(-1, 1) * w.limits.velocity[i];
    }
    const auto fault = w.step(wanted, 60'000, {}, w.random.uniform(0, 1) < 0.2);
    ASSERT_FALSE(fault) << *fault << " at frame " << k;
  }
}

TEST(MotionMonitor, FindsAJointThatMovesByItself) {
  for (int joint = 0; joint < kCArmJointCount; ++joint) {
    Watched w;
    const double speed = 0.2 * w.limits.velocity[joint];
    for (int k = 0; k < 30; ++k) ASSERT_FALSE(w.step(CArmJoints::Zero(), 60'000));
    std::optional<std::string> fault;
    int frames = 0;
    double moved = 0;
    while (!fault && frames < 60) {
      moved += 1e-6 * kFrame_us * speed;
      fault = w.step(CArmJoints::Zero(), 60'000, [&](CArmState& s) { s.joints[joint] += moved; });
      ++frames;
    }
    ASSERT_TRUE(fault) << joint;
    EXPECT_THAT(*fault, HasSubstr("moved uncommanded"));
    EXPECT_LE(frames, 6) << "1 deg at 5 deg/s and 5 mm at 20 mm/s take 0.2 and 0.25 s, less what is forgotten";
  }
}

TEST(MotionMonitor, FindsAJointThatTurnsTheWrongWay) {
  Watched w;
  for (int k = 0; k < 10; ++k) ASSERT_FALSE(w.step(CArmJoints::Zero(), 60'000));
  CArmJoints wanted = CArmJoints::Zero();
  wanted[1] = degToRad(10);
  std::optional<std::string> fault;
  int frames = 0;
  for (; !fault && frames < 60; ++frames) {
    fault = w.step(wanted, 60'000, [&](CArmState& s) { s.joints[1] = -s.joints[1]; });
  }
  ASSERT_TRUE(fault);
  EXPECT_THAT(*fault, HasSubstr("secondary moved uncommanded"));
  EXPECT_LE(frames, 12);  // 0.8 s: it has to get going first, at 40 deg/s^2 and no more than 10 deg/s.
}

TEST(MotionMonitor, FindsAJointThatStandsStill) {
  Watched w;
  CArmJoints wanted = CArmJoints::Zero();
  wanted[0] = degToRad(10);
  wanted[3] = 0.05;
  for (int k = 0; k < 15; ++k) ASSERT_FALSE(w.step(wanted, 60'000));
  const double stuck = w.arm.state().joints[3];
  std::optional<std::string> fault;
  int frames = 0;
  for (; !fault && frames < 60; ++frames) {
    fault = w.step(wanted, 60'000, [&](CArmState& s) { s.joints[3] = stuck; });
  }
  ASSERT_TRUE(fault);
  EXPECT_THAT(*fault, HasSubstr("table y lags behind"));
  EXPECT_LE(frames, 15);  // 20 mm at 50 mm/s are 0.4 s; with the jolt of getting stuck, and forgetting, below 1 s.
}

TEST(MotionMonitor, FindsARunawayThatGoesOnWhenCommandsStop) {
  Watched w;
  CArmJoints wanted = CArmJoints::Zero();
  wanted[0] = degToRad(10);
  for (int k = 0; k < 20; ++k) ASSERT_FALSE(w.step(wanted, 60'000));
  CArmState state = w.arm.state();
  std::optional<std::string> fault;
  int states = 0;
  for (; !fault && states < 60; ++states) {  // No command, not even one that stands still.
    state.time_us += kFrame_us;
    state.joints[0] += 1e-6 * kFrame_us * wanted[0];
    fault = w.monitor.measured(state);
  }
  ASSERT_TRUE(fault);
  EXPECT_LE(states, 18) << "500 ms of latency, 0.6 s to brake gently, 1 deg";
}

TEST(MotionMonitor, BeginsAnewAfterAGapAndBearsTimesThatRunBack) {
  Watched w;
  for (int k = 0; k < 5; ++k) ASSERT_FALSE(w.step(CArmJoints::Zero(), 0));
  CArmState moved = w.arm.state();
  moved.time_us += 2'000'000;
  moved.joints[0] += 0.5;  // Moved by hand, while nobody looked.
  EXPECT_FALSE(w.monitor.measured(moved));
  CArmState back = moved;
  back.time_us -= 1'000'000;
  back.joints[0] = 0;
  EXPECT_FALSE(w.monitor.measured(back));
  back.time_us = std::numeric_limits<std::int64_t>::min() + 2'000'000;
  EXPECT_FALSE(w.monitor.measured(back));
}

}  // namespace
}  // namespace angio::test
