// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/tip_roll.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/geometry/se3.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

// One turn of the drive shows where the tip points, whatever the zero; its Jacobian is what the image did.
TEST(TipRoll, OneTurnTellsWhereTheTipPoints) {
  test::Random random(1);
  for (int k = 0; k < 20; ++k) {
    const double zero = random.uniform(-3, 3), deflection = 0.3, bias = 0.1 * random.normal(), noise = 0.05;
    const Eigen::Vector2d observable_axis(std::cos(0.5 * k), std::sin(0.5 * k));
    const auto shown = [&](double roll) {
      return deflection * observable_axis.dot(Eigen::Vector2d(std::cos(roll + zero), std::sin(roll + zero))) + bias;
    };
    TipRoll roll(0.2, 0);
    EXPECT_GT(roll.std_rad(), 1.2);
    double drive = 0;
    for (int i = 0; i < 45; ++i) {
      roll.move(drive += 2 * kPi / 45, 0);
      TipDeflection d;
      d.slope = shown(drive) + noise * random.normal();
      d.sigma = noise;
      d.observable_axis = observable_axis;
      roll.see(d);
    }
    // Some 45 values of noise 0.05 on a deflection of 0.3, and what a turn itself leaves unsure.
    EXPECT_LT(roll.std_rad(), 0.4);
    EXPECT_LT(std::abs(std::remainder(roll.angle_rad() - drive - zero, 2 * kPi)), 3 * roll.std_rad());
    const double h = 1e-4, jacobian = (shown(drive + h) - shown(drive - h)) / (2 * h);
    const Eigen::Vector2d found = roll.deflection();
    EXPECT_NEAR(observable_axis.dot(Eigen::Vector2d(-found.y(), found.x())), jacobian, 0.12);
  }
}

TEST(TipRoll, ABackAndForthWithinTheDeadBandDoesNotTurnTheTip) {
  TipRoll roll(0.2, 0.4);
  roll.move(1, 0);
  const double before = roll.angle_rad();
  roll.move(1.19, 0);
  roll.move(0.81, 0);
  EXPECT_EQ(roll.angle_rad(), before);
}

// A tip between walls stays where it was seen while its drive turns, and is less and less known to be there.
TEST(TipRoll, ALooseTipDoesNotTurnWithItsDriveAndIsForgottenOnTheWay) {
  TipRoll loose(0.2, 0), follows(0.2, 0);
  for (TipRoll* roll : {&loose, &follows}) {
    for (int i = 0; i < 20; ++i) {
      roll->move(0, 0);
      roll->see({0.2, 0.02, Eigen::Vector2d::UnitX()});
      roll->see({0.0, 0.02, Eigen::Vector2d::UnitY()});
    }
  }
  const Eigen::Vector2d seen = loose.deflection();
  const double sure_rad = loose.std_rad();
  follows.move(0.5, 0);
  loose.moveLoosely(0.5, 0);
  EXPECT_NEAR(follows.angle_rad(), 0.5, 0.1);
  EXPECT_NEAR((loose.deflection().normalized() - seen.normalized()).norm(), 0, 1e-9);
  EXPECT_LT(loose.deflection().norm(), seen.norm());
  EXPECT_GT(loose.std_rad(), std::max(sure_rad, follows.std_rad()));
  loose.moveLoosely(10, 0);
  EXPECT_NEAR(loose.deflection().norm(), 0, 0.01 * seen.norm());
  // Of nothing is known more than the usual deflection.
  EXPECT_NEAR(loose.deflectionCovariance().trace(), 2 * 0.2 * 0.2, 0.01);
}

// A tip that was seen to point one way and is bent may be deflected far beyond that, the same way; straight again, it
// is not.
TEST(TipRoll, ABentTipMayBeDeflectedFurtherTheSameWay) {
  TipRoll roll(0.2, 0);
  for (int i = 0; i < 20; ++i) {
    roll.move(0, 0);
    roll.see({0.2, 0.02, Eigen::Vector2d::UnitX()});
    roll.see({0.0, 0.02, Eigen::Vector2d::UnitY()});
  }
  const Eigen::Vector2d straight = roll.deflection();
  const Eigen::Matrix2d sure = roll.deflectionCovariance();
  const double angle_std_rad = roll.std_rad();
  roll.bend(0.5);
  const Eigen::Matrix2d bent = roll.deflectionCovariance();
  EXPECT_NEAR((roll.deflection() - straight).norm(), 0, 1e-12) << "nobody has seen it yet";
  // Along it, by what the bend may add; across it in proportion, so that its angle is no surer when it is seen.
  const Eigen::Vector2d along = straight.normalized(), across(-along.y(), along.x());
  const double may_add = std::min(1.0, straight.squaredNorm() / 0.04) * (0.25 - 0.04);
  EXPECT_NEAR(across.dot(bent * across), 6.25 * across.dot(sure * across), 1e-9);
  EXPECT_NEAR(along.dot(bent * along), 6.25 * along.dot(sure * along) + may_add, 1e-9);
  for (int i = 0; i < 20; ++i) roll.see({0.5, 0.02, Eigen::Vector2d::UnitX()});
  EXPECT_GT(roll.deflection().x(), 0.4);
  EXPECT_LT(roll.std_rad(), 1.2 * angle_std_rad) << "a bend does not turn it";
  const Eigen::Vector2d far = roll.deflection();
  roll.bend(0.2);
  EXPECT_NEAR((roll.deflection() - 0.4 * far).norm(), 0, 1e-12);
  EXPECT_LE(std::sqrt(roll.deflectionCovariance()(1, 1)), 0.2 + 1e-9);
}

}  // namespace
}  // namespace angio::test
