// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/robot/motion_time.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/test/random.hpp"

namespace angio::test {
namespace {

// The joint that accelerates as long as it can still stop, brakes then, and whose acceleration takes its time: a search
// over its highest acceleration and speed by the way each pair makes.
double bySearch(double d, double v_max, double a_max, double j) {
  const auto rampDistance = [&](double a, double v) {  // To the speed v and back to rest, and how long that takes.
    const double t = a / j + v / a;
    return std::pair(v * t, 2 * t);
  };
  double best = std::numeric_limits<double>::infinity();
  for (int i = 1; i <= 1000; ++i) {
    const double a = a_max * i / 1000;
    // The speed at which the ramps alone make the way, at least what lets the acceleration be reached.
    const double v_ramps = 0.5 * (-a * a / j + std::sqrt(a * a * a * a / (j * j) + 4 * a * d));
    const double v = std::min(v_max, v_ramps);
    if (v < a * a / j * (1 - 1e-12)) continue;
    const auto [distance, time_s] = rampDistance(a, v);
    best = std::min(best, time_s + (d - distance) / v);
  }
  return best;
}

TEST(MotionTime, IsTheBestOfAllDoubleS) {
  test::Random random(1);
  for (int i = 0; i < 300; ++i) {
    CArmLimits limits = CArmLimits::typical();
    limits.velocity[0] = std::exp(random.uniform(-3, 1));
    limits.acceleration[0] = std::exp(random.uniform(-3, 1));
    limits.jerk[0] = std::exp(random.uniform(-2, 3));
    CArmJoints to = CArmJoints::Zero();
    to[0] = (i % 2 ? 1 : -1) * std::exp(random.uniform(-6, 1));
    const double searched_s = bySearch(std::abs(to[0]), limits.velocity[0], limits.acceleration[0], limits.jerk[0]);
    const double closed_s = minTime_s(CArmJoints::Zero(), to, limits);
    // The search has 1000 steps of acceleration.
    EXPECT_LE(closed_s, searched_s * (1 + 1e-9)) << i;
    EXPECT_GE(closed_s, searched_s * (1 - 3e-3)) << i;
  }
}

TEST(MotionTime, IsTheSlowestJoints) {
  const CArmLimits limits = CArmLimits::typical();
  CArmJoints to = CArmJoints::Zero();
  EXPECT_EQ(minTime_s(to, to, limits), 0);
  to[0] = 50 * kPi / 180;  // 2 s at 25 deg/s, and twice half of 25/40 s and 40/160 s for the ramps.
  EXPECT_NEAR(minTime_s(CArmJoints::Zero(), to, limits), 2 + 0.625 + 0.25, 1e-12);
  to[4] = 0.29;
  EXPECT_NEAR(minTime_s(CArmJoints::Zero(), to, limits), 2.9 + 0.5 + 0.25, 1e-12);
}

}  // namespace
}  // namespace angio::test
