// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/shaft_offset.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/navigation/tip_roll.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

constexpr double kSeen_m = 0.3e-3;  // Standard deviation of what a frame shows.

// A tip that is not bent: all that is seen is the shaft's.
TipOffset straight() { return {Eigen::Vector2d::Zero(), Eigen::Matrix2d::Zero(), 0}; }

// A shaft that wanders over 10 mm with a standard deviation of `usual_m` per axis, of which one axis is seen.
ShaftOffset afterAJourney(double usual_m, unsigned seed, int* covered = nullptr) {
  test::Random random(seed);
  ShaftOffset shaft;
  Eigen::Vector2d truth = usual_m * Eigen::Vector2d(random.normal(), random.normal());
  const double slid_m = 1e-3, keep = std::exp(-slid_m / 10e-3), fresh_m = std::sqrt(1 - keep * keep) * usual_m;
  for (int k = 0; k < 1000; ++k) {
    shaft.move(slid_m, 0);
    truth = keep * truth + fresh_m * Eigen::Vector2d(random.normal(), random.normal());
    shaft.see(straight(), Eigen::Vector2d::UnitX(), truth.x() + kSeen_m * random.normal(), kSeen_m);
    const TipOffset found = shaft.with(straight());
    if (covered && k >= 200)
      *covered += std::abs(truth.y() - found.mean_m.y()) < 1.5 * std::sqrt(found.covariance(1, 1));
  }
  return shaft;
}

// What is seen across the beam tells how large the offset along it may be: of a catheter that keeps to where its bend
// puts it, and of one that lies anywhere. 1.5 standard deviations hold 87 % of normal values; 800 of them of some 80
// independent ones give or take 4 %, and the size that is learnt from a few ways is itself off by a quarter.
TEST(ShaftOffset, LearnsFromTheSeenAxisHowFarTheOtherMayBeOff) {
  int firm = 0, loose = 0;
  EXPECT_LT(afterAJourney(0.15e-3, 1, &firm).looseness(), 0.2);
  EXPECT_GT(afterAJourney(1.3e-3, 2, &loose).looseness(), 0.6);
  EXPECT_GT(firm, 0.75 * 800);
  EXPECT_GT(loose, 0.75 * 800);
  EXPECT_LT(loose, 0.99 * 800) << "it claims far too little";
}

// One view shows one component, two views both; what has slid on is as unknown as before.
TEST(ShaftOffset, TwoViewsShowBothComponentsUntilTheTipSlidesOn) {
  ShaftOffset shaft = afterAJourney(1.3e-3, 3);
  shaft.move(0.1, 0);
  const Eigen::Vector2d truth(1.1e-3, -0.9e-3);
  const auto look = [&](const Eigen::Vector2d& axis) {
    for (int k = 0; k < 20; ++k) shaft.see(straight(), axis, axis.dot(truth), kSeen_m);
  };
  look(Eigen::Vector2d::UnitX());
  const TipOffset one = shaft.with(straight());
  EXPECT_NEAR(one.mean_m.x(), truth.x(), 2 * kSeen_m / std::sqrt(20.0));
  EXPECT_NEAR(one.mean_m.y(), 0, 0.05e-3);
  EXPECT_GT(one.covariance(1, 1), 0.6e-6);
  look(Eigen::Vector2d::UnitY());
  const TipOffset both = shaft.with(straight());
  EXPECT_LT((both.mean_m - truth).norm(), 2 * kSeen_m / std::sqrt(20.0) * std::sqrt(2.0));
  EXPECT_LT(both.covariance.trace(), 0.05e-6);
  shaft.move(0.1, 0);
  EXPECT_LT(shaft.with(straight()).mean_m.norm(), 1e-6);
  EXPECT_GT(shaft.with(straight()).covariance.trace(), 1.2e-6);
}

// The length of a deflection is no constraint on a tip whose shaft lies elsewhere.
TEST(ShaftOffset, ALooseShaftHidesTheLengthOfTheBendsDeflection) {
  TipOffset bent;
  bent.free_m = 2.5e-3;
  EXPECT_EQ(afterAJourney(0.15e-3, 4).with(bent).free_m, bent.free_m);
  EXPECT_EQ(afterAJourney(1.3e-3, 5).with(bent).free_m, 0);
}

// A shaft's slope does not turn with the drive, the tip's bend does: a turn seen in two views tells them apart, and the
// tip points where both together do.
TEST(TipRoll, ATurnTellsTheBendFromTheShaftsSlope) {
  test::Random random(6);
  const Eigen::Vector2d slope(0.25, -0.2);
  const double zero = 0.8, deflection = 0.3, noise = 0.03;
  TipRoll roll(0.3, 0);
  double drive = 0;
  Eigen::Vector2d truth;
  for (int i = 0; i < 90; ++i) {
    roll.move(drive += 4 * kPi / 90, 0);
    truth = slope + deflection * Eigen::Vector2d(std::cos(drive + zero), std::sin(drive + zero));
    const Eigen::Vector2d axis = i < 45 ? Eigen::Vector2d::UnitX() : Eigen::Vector2d::UnitY();
    roll.see({axis.dot(truth) + noise * random.normal(), noise, axis});
  }
  const Eigen::Vector2d off = roll.heading() - truth;
  EXPECT_LT(off.dot(roll.headingCovariance().inverse() * off), 9.2) << "a chance of 1 % for two components";
  EXPECT_LT(roll.headingCovariance().trace(), 0.1);
  EXPECT_LT(std::abs(std::remainder(roll.angle_rad() - drive - zero, 2 * kPi)), 3 * roll.std_rad());
}

}  // namespace
}  // namespace angio::test
