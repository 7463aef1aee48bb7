// SPDX-License-Identifier: GPL-2.0-or-later
// Elastic rods that slide along walls, against closed forms.
#include "angio/rod/elastic_rod.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "angio/geometry/se3.hpp"
#include "tubes.hpp"

namespace angio::test {
namespace {

RodSettings thinRod() {
  RodSettings settings;
  settings.radius_m = 0.5e-3;
  settings.spacing_m = settings.tip_spacing_m = 2e-3;
  settings.wall_pa = 1e7;
  return settings;
}

// T_base = T_tip exp(+-mu angle): Euler and Eytelwein.
TEST(ElasticRod, SlidesAroundABendAsARopeAroundACapstan) {
  constexpr double kStraight_m = 0.05, kBend_m = 0.05, kPull_n = 0.5;
  for (const auto& [mu, angle] : {std::pair(0.05, kPi / 2), std::pair(0.2, kPi)}) {
    RodSettings settings = thinRod();
    settings.shaft_bending_n_m2 = settings.tip_bending_n_m2 = 1e-6;  // Hardly to be felt beside the load.
    settings.stretching_n = 1e4;
    settings.friction = mu;
    const double length_m = 2 * kStraight_m + kBend_m * angle;
    ElasticRod rod(Lumen(bentTube(kStraight_m, kBend_m, angle, 1e-3)), settings, {{0, length_m - 5e-3}});
    rod.load(kPull_n * Eigen::Vector3d(std::sin(angle), 0, std::cos(angle)));
    for (const double sign : {1, -1}) {  // Pulled back against friction; let in, and held by it.
      for (int k = 0; k < 10; ++k) rod.move({sign * -0.5e-3, 0});
      EXPECT_TRUE(rod.effort().at_rest);
      const double closed_n = kPull_n * std::exp(sign * mu * angle);
      expectClosedForm("capstan of mu " + std::to_string(mu) + (sign > 0 ? ", pulled" : ", let in"),
                       -rod.forces().insertion_n, closed_n);
    }
  }
}

// A rod bent by a vessel is held about itself by r mu for each newton of the wall's force, until the base has turned by
// what winds its length up; sliding along lets that out again.
TEST(ElasticRod, WindsUpAndSlidingLetsItOut) {
  RodSettings settings = thinRod();
  settings.shaft_bending_n_m2 = settings.tip_bending_n_m2 = 1e-4;
  settings.friction = 0.3;
  constexpr double kStraight_m = 0.04, kBend_m = 0.03;
  ElasticRod rod(Lumen(bentTube(kStraight_m, kBend_m, kPi / 2, 1e-3)), settings, {{0, 0.1}});
  const auto windUp = [&] { return -rod.shape().twists.sum(); };
  for (int k = 0; k < 40; ++k) rod.move({0, 0.05});
  ASSERT_TRUE(rod.effort().at_rest);
  const double wound = windUp();
  // The twist at the base is the torque over the stiffness; it cannot be more than if all walls held against it.
  const double torque_nm = -settings.twist_per_bending * 1e-4 * rod.shape().twists[1] / rod.body().share_m(1);
  double held_nm = 0;
  for (Eigen::Index i = 2; i < rod.shape().size(); ++i)
    held_nm += settings.friction * settings.radius_m * rod.forces().wall_n.col(i).norm();
  EXPECT_GT(wound, 0.01);
  EXPECT_LE(torque_nm, held_nm);
  EXPECT_GT(torque_nm, 0.8 * held_nm);  // All of it slides, but for the points that slide along too.
  for (int k = 0; k < 20; ++k) rod.move({1e-4, 0});
  EXPECT_LT(windUp(), 0.3 * wound);
}

// Against what a steady push does, the tip against the end of the vessel, the base feels at least what the tip does.
TEST(ElasticRod, WhatTheDrivePushesTheTipPushes) {
  RodSettings settings = thinRod();
  settings.friction = 0;
  settings.spacing_m = 3e-3;
  ElasticRod rod(Lumen(straightTube(0.1, 1e-3)), settings, {{0, 0.0995}});
  for (int k = 0; k < 10; ++k) rod.move({2e-4, 0});
  ASSERT_TRUE(rod.effort().at_rest);
  const RodForces forces = rod.forces();
  EXPECT_GT(forces.insertion_n, 0.3);
  EXPECT_NEAR(forces.tip_n, forces.insertion_n,
              0.05 * forces.insertion_n);  // The tube is narrow, and the rod straight.
  EXPECT_NEAR(forces.wall_n.row(2).sum(), -forces.insertion_n, 0.02 * forces.insertion_n);
}

}  // namespace
}  // namespace angio::test
