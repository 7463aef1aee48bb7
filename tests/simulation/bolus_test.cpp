// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/bolus.hpp"

#include <gtest/gtest.h>

#include "angio/base/errors.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/test/phantoms.hpp"

namespace angio {
namespace {

// Along x in steps of 10 mm, 2 mm wide at first and 1 mm from the middle on.
VesselTree line() {
  Eigen::Matrix3Xd points = Eigen::Matrix3Xd::Zero(3, 21);
  std::vector<int> parents;
  std::vector<std::optional<double>> radii;
  for (int i = 0; i <= 20; ++i) {
    points(0, i) = 0.01 * i;
    parents.push_back(i - 1);
    radii.push_back(i <= 10 ? 2e-3 : 1e-3);
  }
  return VesselTree(points, parents, radii);
}

BolusSettings settings() {
  BolusSettings s;
  s.enabled = true;
  s.start_s = 0.5;
  s.speed_m_per_s = 0.2;
  s.injection_s = 1;
  return s;
}

TEST(Bolus, TheFrontIsWhereTheBloodHasCarriedIt) {
  const Bolus bolus(line(), settings());
  EXPECT_NEAR(bolus.arrival_s()[10], 0.1 / 0.2, 1e-12);
  // Ten millimetres at three quarters of the speed, where the radius changes, then 90 at half of it.
  EXPECT_NEAR(bolus.arrival_s()[20], 0.5 + 0.01 / 0.15 + 0.09 / 0.1, 1e-12);
  // At the front the density is a half, before it less, behind it more.
  const double time_s = 0.5 + bolus.arrival_s()[14];
  const Eigen::VectorXd density = bolus.densities(time_s);
  EXPECT_NEAR(density[14], 0.5, 1e-12);
  EXPECT_GT(density[10], 0.9);
  EXPECT_LT(density[18], 0.1);
}

TEST(Bolus, FillsAndLeavesTheTree) {
  const Bolus bolus(line(), settings());
  EXPECT_LT(bolus.densities(0).maxCoeff(), 0.01);
  EXPECT_NEAR(bolus.densities(1.4)[0], 1, 0.01);
  EXPECT_LT(bolus.densities(60).maxCoeff(), 1e-3);
  double last = 0;
  for (double t = 0; t < 60; t += 0.05) {  // No jumps, within its bounds.
    const double density = bolus.densities(t)[15];
    EXPECT_GE(density, 0);
    EXPECT_LE(density, 1);
    EXPECT_LT(std::abs(density - last), 0.3);
    last = density;
  }
  EXPECT_EQ(Bolus(line(), {}).densities(-5), Eigen::VectorXd::Ones(21));
}

TEST(Bolus, NeedsRadiiAndSoundSettings) {
  const VesselTree tree = line();
  EXPECT_THROW(Bolus(VesselTree(tree.points(), tree.parents()), settings()), InputError);
  BolusSettings wrong = settings();
  wrong.wash_in_s = -1;
  EXPECT_THROW(Bolus(tree, wrong), InputError);
}

}  // namespace
}  // namespace angio
