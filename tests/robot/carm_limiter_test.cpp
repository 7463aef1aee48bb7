// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/robot/carm_limiter.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "angio/test/random.hpp"

namespace angio {
namespace {

constexpr double kDt = 1.0 / 15;
// Rounding of sums of numbers around one.
constexpr double kRounding = 1e-12;

CArmJoints randomWithin(test::Random& random, const CArmJoints& bound) {
  return CArmJoints::NullaryExpr([&](Eigen::Index i) { return random.uniform(-bound[i], bound[i]); });
}

TEST(CArmLimiter, FastWishesAreShortenedInTheirDirection) {
  const CArmLimits limits = CArmLimits::typical();
  test::Random random(1);
  for (int i = 0; i < 200; ++i) {
    const CArmJoints wanted = randomWithin(random, 5 * limits.velocity);
    const CArmJoints v = withinSpeed(wanted, limits);
    const double fastest = v.cwiseAbs().cwiseQuotient(limits.velocity).maxCoeff();
    const double factor = v.norm() / wanted.norm();
    EXPECT_LE(fastest, 1 + kRounding);
    EXPECT_LT((v - factor * wanted).norm(), kRounding);
    if (factor < 1 - kRounding) {
      EXPECT_NEAR(fastest, 1, kRounding) << "shortened more than needed";
    }
  }
  const CArmJoints slow = 0.5 * limits.velocity;
  EXPECT_EQ(withinSpeed(slow, limits), slow);
}

TEST(CArmLimiter, ChangesAreShortenedInTheirDirection) {
  const CArmLimits limits = CArmLimits::typical();
  test::Random random(2);
  int shortened = 0;
  for (int i = 0; i < 200; ++i) {
    const CArmJoints wanted = randomWithin(random, limits.velocity), current = randomWithin(random, limits.velocity);
    // At mid-range the ends are seconds away, so only the first two laws speak.
    const CArmJoints v = limited(wanted, current, CArmJoints::Zero(), limits, kDt);
    const CArmJoints change = v - current;
    const double hardest = change.cwiseAbs().cwiseQuotient(limits.acceleration * kDt).maxCoeff();
    const double factor = change.norm() / (wanted - current).norm();
    EXPECT_LE(hardest, 1 + kRounding);
    EXPECT_LT((change - factor * (wanted - current)).norm(), kRounding);
    if (factor < 1 - kRounding) {
      EXPECT_NEAR(hardest, 1, kRounding) << "shortened more than needed";
      ++shortened;
    }
  }
  EXPECT_GT(shortened, 100);
}

TEST(CArmLimiter, ReachesASteadyWishExactly) {
  const CArmLimits limits = CArmLimits::typical();
  const CArmJoints wanted = 0.3 * limits.velocity;
  CArmJoints v = CArmJoints::Zero();
  for (int i = 0; i < 60; ++i) v = limited(wanted, v, CArmJoints::Zero(), limits, kDt);
  EXPECT_LT((v - wanted).norm(), kRounding);
}

TEST(CArmLimiter, SpeedTowardsAnEndAllowsBraking) {
  const CArmLimits limits = CArmLimits::typical();
  test::Random random(3);
  for (int i = 0; i < 500; ++i) {
    CArmJoints joints = limits.upper;
    for (int k = 0; k < kCArmJointCount; ++k) joints[k] -= std::pow(10, random.uniform(-6, -1));
    const CArmJoints v = limited(limits.velocity, limits.velocity, joints, limits, kDt);
    for (int k = 0; k < kCArmJointCount; ++k) {
      const double distance = limits.upper[k] - joints[k];
      EXPECT_LE(v[k], std::sqrt(2 * limits.acceleration[k] * distance));
      EXPECT_LE(v[k] * kDt, distance + kRounding) << "steps over the end";
      EXPECT_GE(v[k], 0);
    }
  }
}

TEST(CArmLimiter, StopsAtAndBeyondTheEndsButLetsBackIn) {
  const CArmLimits limits = CArmLimits::typical();
  for (const double beyond : {0.0, 0.01}) {
    for (const double side : {1.0, -1.0}) {
      const CArmJoints joints = side * (limits.upper.array() + beyond).matrix();
      EXPECT_TRUE(limited(side * limits.velocity, side * limits.velocity, joints, limits, kDt).isZero(0));
      const CArmJoints back = limited(-side * limits.velocity, CArmJoints::Zero(), joints, limits, kDt);
      EXPECT_GT((-side * back).minCoeff(), 0);
    }
  }
}

TEST(CArmLimiter, NeverLeavesTheRangeNorBrakesHarderThanItMayWhateverIsWanted) {
  const CArmLimits limits = CArmLimits::typical();
  test::Random random(4);
  CArmJoints joints = CArmJoints::Zero(), v = CArmJoints::Zero(), wanted = CArmJoints::Zero();
  double furthest = 0;
  for (int i = 0; i < 20000; ++i) {
    if (i % 200 == 0) wanted = randomWithin(random, 3 * limits.velocity);
    const CArmJoints next = limited(wanted, v, joints, limits, kDt);
    EXPECT_LE((next - v).cwiseAbs().cwiseQuotient(limits.acceleration * kDt).maxCoeff(), 1 + 1e-9) << "step " << i;
    v = next;
    joints += kDt * v;
    EXPECT_TRUE(((limits.upper - joints).array() >= -kRounding).all() &&
                ((joints - limits.lower).array() >= -kRounding).all());
    furthest = std::max(furthest, joints.cwiseAbs().cwiseQuotient(limits.upper).maxCoeff());
  }
  EXPECT_GT(furthest, 0.999) << "the ends were never reached, so nothing was tested";
}

TEST(CArmLimiter, WhatIsNotANumberStandsStill) {
  const CArmLimits limits = CArmLimits::typical();
  const CArmJoints ok = 0.1 * limits.velocity;
  ASSERT_FALSE(limited(ok, ok, CArmJoints::Zero(), limits, kDt).isZero(0));
  for (const double wrong : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    for (int i = 0; i < kCArmJointCount; ++i) {
      CArmJoints bad = CArmJoints::Zero();
      bad[i] = wrong;
      EXPECT_TRUE(withinSpeed(bad, limits).isZero(0));
      EXPECT_TRUE(limited(bad, ok, ok, limits, kDt).isZero(0));
      EXPECT_TRUE(limited(ok, bad, ok, limits, kDt).isZero(0));
      EXPECT_TRUE(limited(ok, ok, bad, limits, kDt).isZero(0));
      for (const auto member :
           {&CArmLimits::lower, &CArmLimits::upper, &CArmLimits::velocity, &CArmLimits::acceleration}) {
        CArmLimits bad_limits = limits;
        bad_limits.*member = bad;
        EXPECT_TRUE(limited(ok, ok, ok, bad_limits, kDt).isZero(0));
      }
    }
    EXPECT_TRUE(limited(ok, ok, ok, limits, wrong).isZero(0));
  }
  EXPECT_TRUE(limited(ok, ok, ok, limits, 0).isZero(0));
}

}  // namespace
}  // namespace angio
