// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/simulated_carm.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "angio/base/errors.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

constexpr double kRounding = 1e-9;  // Times are whole microseconds in double; far below what an encoder resolves.

CArmCommand command(std::int64_t sequence, const CArmJoints& velocity, std::int64_t valid_for_us = 1'000'000,
                    std::int64_t frame_us = 0) {
  CArmCommand result;
  result.time_us = frame_us;
  result.sequence = sequence;
  result.valid_for_us = valid_for_us;
  result.velocity = velocity;
  return result;
}

TEST(SimulatedCArm, ReachesTheCommandedVelocityAtTheAccelerationLimit) {
  const CArmLimits limits = CArmLimits::typical();
  SimulatedCArm carm(limits, CArmJoints::Zero(), 0);
  const CArmJoints wanted = 0.8 * limits.velocity;
  carm.obey(command(1, wanted), 0);
  const double rise_s = wanted[0] / limits.acceleration[0];  // 0.5 s
  carm.advance(std::llround(0.5e6 * rise_s));
  EXPECT_NEAR(carm.state().velocity[0], 0.5 * wanted[0], kRounding);
  EXPECT_NEAR(carm.state().joints[0], 0.125 * wanted[0] * rise_s, kRounding);
  carm.advance(900'000);
  EXPECT_EQ(carm.state().velocity[0], wanted[0]);
  EXPECT_NEAR(carm.state().joints[0], wanted[0] * (0.9 - 0.5 * rise_s), kRounding);
  EXPECT_EQ(carm.state().time_us, 900'000);
}

TEST(SimulatedCArm, StaysWithinItsLimitsWhateverItIsTold) {
  CArmLimits limits = CArmLimits::typical();
  limits.lower *= 0.05;  // Narrow, so that it meets the ends often.
  limits.upper *= 0.05;
  test::Random random(11);
  SimulatedCArm carm(limits, CArmJoints::Zero(), 0);
  std::int64_t now_us = 0;
  int at_an_end = 0;
  for (int i = 0; i < 10'000; ++i) {
    CArmJoints wanted;
    for (int k = 0; k < kCArmJointCount; ++k) wanted[k] = random.uniform(-3, 3) * limits.velocity[k];
    if (i % 7 < 3) wanted = 5 * limits.velocity;  // Long enough against one end.
    carm.obey(command(i, wanted, 1 + static_cast<std::int64_t>(random.uniform(0, 300'000)), now_us), now_us);
    const CArmState before = carm.state();
    const auto step_us = 1 + static_cast<std::int64_t>(random.uniform(0, i % 2 ? 5'000 : 400'000));
    carm.advance(now_us += step_us);
    const CArmState after = carm.state();
    const double step_s = 1e-6 * static_cast<double>(step_us);
    for (int k = 0; k < kCArmJointCount; ++k) {
      ASSERT_GE(after.joints[k], limits.lower[k]);
      ASSERT_LE(after.joints[k], limits.upper[k]);
      ASSERT_LE(std::abs(after.velocity[k]), limits.velocity[k]);
      ASSERT_LE(std::abs(after.velocity[k] - before.velocity[k]), limits.acceleration[k] * step_s + kRounding);
      // The way it went is one that its speeds and accelerations allow: no jumps.
      const double moved = after.joints[k] - before.joints[k];
      ASSERT_LE(std::abs(moved - before.velocity[k] * step_s),
                0.5 * limits.acceleration[k] * step_s * step_s + kRounding);
      // What is left of the range is enough to brake.
      const double v = after.velocity[k], stop = v * std::abs(v) / (2 * limits.acceleration[k]);
      ASSERT_LE(after.joints[k] + stop, limits.upper[k] + kRounding);
      ASSERT_GE(after.joints[k] + stop, limits.lower[k] - kRounding);
      at_an_end += after.joints[k] == limits.upper[k] && v == 0;
    }
  }
  EXPECT_GT(at_an_end, 500);
  EXPECT_EQ(carm.ignored().total(), 0);
}

TEST(SimulatedCArm, MovesTheSameHoweverOftenItIsAsked) {
  CArmLimits limits = CArmLimits::typical();
  limits.upper[0] = 0.1;
  SimulatedCArm rare(limits, CArmJoints::Zero(), 0), often(limits, CArmJoints::Zero(), 0);
  rare.obey(command(1, limits.velocity, 600'000), 0);
  often.obey(command(1, limits.velocity, 600'000), 0);
  for (std::int64_t now_us = 0; now_us <= 1'500'000; now_us += 250) often.advance(now_us);
  rare.advance(1'500'000);
  EXPECT_LT((rare.state().joints - often.state().joints).norm(), kRounding);
  EXPECT_EQ(rare.state().joints[0], 0.1);
  EXPECT_EQ(rare.state().velocity, CArmJoints::Zero());
}

TEST(SimulatedCArm, SilenceStopsIt) {
  const CArmLimits limits = CArmLimits::typical();
  SimulatedCArm carm(limits, CArmJoints::Zero(), 0);
  carm.obey(command(1, limits.velocity, 800'000), 0);
  carm.advance(800'000);
  EXPECT_EQ(carm.state().velocity, limits.velocity);
  EXPECT_EQ(carm.ranOut(), 0);
  const double brake_s = (limits.velocity.array() / limits.acceleration.array()).maxCoeff();
  carm.advance(800'000 + static_cast<std::int64_t>(std::ceil(brake_s * 1e6)));
  EXPECT_EQ(carm.state().velocity, CArmJoints::Zero());
  const CArmJoints rest = carm.state().joints;
  carm.advance(60'000'000);
  EXPECT_EQ(carm.state().joints, rest);
  EXPECT_EQ(carm.ranOut(), 1);
}

TEST(SimulatedCArm, IgnoresCommandsItMustNotObeyAndSaysWhy) {
  const CArmLimits limits = CArmLimits::typical();
  SimulatedCArm carm(limits, CArmJoints::Zero(), 0);
  const CArmJoints wanted = 0.1 * limits.velocity;
  carm.obey(command(5, wanted), 0);
  CArmJoints broken = limits.velocity;
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    broken[3] = bad;
    carm.obey(command(6, broken), 0);
  }
  for (const std::int64_t bad :
       {std::int64_t{0}, std::int64_t{-1}, std::int64_t{1'000'001}, std::numeric_limits<std::int64_t>::max()}) {
    carm.obey(command(6, limits.velocity, bad), 0);
  }
  for (const std::int64_t old : {5, 4, -1}) carm.obey(command(old, limits.velocity), 0);
  EXPECT_EQ(carm.ignored().not_finite, 2);
  EXPECT_EQ(carm.ignored().bad_validity, 4);
  EXPECT_EQ(carm.ignored().out_of_sequence, 3);
  carm.advance(900'000);
  EXPECT_EQ(carm.state().velocity, wanted);  // The last good one holds.
  carm.obey(command(6, CArmJoints::Zero()), 900'000);
  carm.advance(1'200'000);
  EXPECT_EQ(carm.state().velocity, CArmJoints::Zero());
  EXPECT_EQ(carm.ignored().total(), 9);
}

TEST(SimulatedCArm, TimeDoesNotRunBackwards) {
  SimulatedCArm carm(CArmLimits::typical(), CArmJoints::Zero(), 1'000'000);
  carm.obey(command(1, CArmLimits::typical().velocity, 1'000'000, 1'000'000), 1'000'000);
  carm.advance(1'200'000);
  const CArmState state = carm.state();
  carm.advance(500'000);
  carm.advance(std::numeric_limits<std::int64_t>::min());
  EXPECT_EQ(carm.state().time_us, state.time_us);
  EXPECT_EQ(carm.state().joints, state.joints);
  carm.advance(std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ(carm.state().velocity, CArmJoints::Zero());
}

TEST(SimulatedCArm, IgnoresMotionByAFrameOfAnotherTime) {
  const CArmLimits limits = CArmLimits::typical();
  const ReceiverSettings receiver;
  const std::int64_t now_us = 10'000'000, oldest_us = now_us - std::llround(1e3 * receiver.max_command_age_ms),
                     newest_us = now_us + std::llround(1e3 * receiver.max_command_lead_ms);
  SimulatedCArm carm(limits, CArmJoints::Zero(), now_us);
  std::int64_t sequence = 0;
  for (const std::int64_t frame_us : {oldest_us - 1, newest_us + 1, std::numeric_limits<std::int64_t>::min(),
                                      std::numeric_limits<std::int64_t>::max()}) {
    carm.obey(command(++sequence, limits.velocity, 1'000'000, frame_us), now_us);
  }
  EXPECT_EQ(carm.ignored().too_old, 4);
  carm.advance(now_us + 100'000);
  EXPECT_EQ(carm.state().velocity, CArmJoints::Zero());
  for (const std::int64_t frame_us : {oldest_us + 100'000, newest_us + 100'000}) {
    carm.obey(command(++sequence, 0.1 * limits.velocity, 1'000'000, frame_us), now_us + 100'000);
  }
  EXPECT_EQ(carm.ignored().total(), 4);
  carm.obey(command(++sequence, CArmJoints::Zero(), 1'000'000, oldest_us), now_us + 200'000);
  EXPECT_EQ(carm.ignored().total(), 4) << "a command to stand still is never too old";
}

TEST(SimulatedCArm, TakesSpeedsFarBeyondItsLimitsForWrongUnits) {
  const CArmLimits limits = CArmLimits::typical();
  SimulatedCArm carm(limits, CArmJoints::Zero(), 0);
  CArmJoints wanted = 0.5 * limits.velocity;
  wanted[0] *= 180 / kPi;  // Degrees for radians.
  carm.obey(command(1, wanted), 0);
  wanted = 0.5 * limits.velocity;
  wanted[4] *= -1000;  // Millimetres for metres.
  carm.obey(command(2, wanted), 0);
  EXPECT_EQ(carm.ignored().wrong_unit, 2);
  carm.advance(200'000);
  EXPECT_EQ(carm.state().joints, CArmJoints::Zero());
  carm.obey(command(3, 5 * limits.velocity), 200'000);  // Too fast, in the right unit: cut to the limits.
  carm.advance(1'100'000);
  EXPECT_EQ(carm.state().velocity, limits.velocity);
}

TEST(SimulatedCArm, RefusesAnImpossibleSetUp) {
  CArmLimits limits = CArmLimits::typical();
  EXPECT_THROW(SimulatedCArm(limits, 2 * limits.upper, 0), InputError);
  EXPECT_THROW(SimulatedCArm(limits, CArmJoints::Constant(std::nan("")), 0), InputError);
  limits.acceleration[2] = 0;
  EXPECT_THROW(SimulatedCArm(limits, CArmJoints::Zero(), 0), InputError);
}

}  // namespace
}  // namespace angio::test
