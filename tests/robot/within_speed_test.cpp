// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/robot/motion_time.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "angio/test/random.hpp"

namespace angio::test {
namespace {

constexpr double kRounding = 1e-12;  // Of sums of numbers around one.

TEST(WithinSpeed, FastWishesAreShortenedInTheirDirection) {
  const CArmLimits limits = CArmLimits::typical();
  test::Random random(1);
  for (int i = 0; i < 200; ++i) {
    const CArmJoints wanted = CArmJoints::NullaryExpr(
        [&](Eigen::Index k) { return 5 * random.uniform(-limits.velocity[k], limits.velocity[k]); });
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

TEST(WithinSpeed, WhatIsNotANumberStandsStill) {
  const CArmLimits limits = CArmLimits::typical();
  for (const double wrong : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    for (int i = 0; i < kCArmJointCount; ++i) {
      CArmJoints bad = CArmJoints::Zero();
      bad[i] = wrong;
      EXPECT_TRUE(withinSpeed(bad, limits).isZero(0));
      CArmLimits bad_limits = limits;
      bad_limits.velocity = bad;
      EXPECT_TRUE(withinSpeed(0.1 * limits.velocity, bad_limits).isZero(0));
    }
  }
}

}  // namespace
}  // namespace angio::test
