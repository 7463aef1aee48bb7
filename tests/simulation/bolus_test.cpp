// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/bolus.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/base/errors.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/simulation/simulated_patient.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
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

BolusSettings onDemand() {
  BolusSettings s = settings();
  s.trigger = BolusTrigger::kDemand;
  return s;
}

TEST(Bolus, HoldsNoContrastAgentUntilItIsDemanded) {
  Bolus bolus(line(), onDemand());
  EXPECT_EQ(bolus.densities(1.5), Eigen::VectorXd::Zero(21));
  bolus.endInjection(1);
  EXPECT_EQ(bolus.densities(1.5), Eigen::VectorXd::Zero(21));
  bolus.beginInjection(2);
  bolus.endInjection(2);
  EXPECT_EQ(bolus.densities(2.5), Eigen::VectorXd::Zero(21));
}

TEST(Bolus, AnInjectionOnDemandIsThatOfTheSettings) {
  const Bolus planned(line(), settings());
  Bolus demanded(line(), onDemand());
  demanded.beginInjection(0.5);
  demanded.beginInjection(0.9);  // One is open: no other begins.
  demanded.endInjection(1.5);
  demanded.endInjection(1.7);
  for (double t = 0; t < 10; t += 0.1) ASSERT_EQ(demanded.densities(t), planned.densities(t)) << t;
}

TEST(Bolus, AnOpenInjectionKeepsTheTreeFull) {
  Bolus bolus(line(), onDemand());
  bolus.beginInjection(3);
  EXPECT_NEAR(bolus.densities(3 + bolus.arrival_s()[14])[14], 0.5, 1e-12);
  EXPECT_GT(bolus.densities(60).minCoeff(), 1 - 1e-12);
  const Eigen::VectorXd before = bolus.densities(60);
  bolus.endInjection(60);
  EXPECT_EQ(bolus.densities(60), before) << "the end arrives with the blood";
  // The point where the end has been for one time constant: wash-out and dispersion.
  const double arrival_s = bolus.arrival_s()[14], tail_s = onDemand().wash_out_s + onDemand().dispersion * arrival_s;
  EXPECT_NEAR(bolus.densities(60 + arrival_s + tail_s)[14], std::exp(-1.0), 1e-12);
  EXPECT_LT(bolus.densities(120).maxCoeff(), 1e-12);
}

TEST(Bolus, EachInjectionHasItsFrontAndItsEnd) {
  Bolus bolus(line(), onDemand());
  for (const double begin_s : {0.0, 60.0, 120.0}) {
    bolus.beginInjection(begin_s);
    bolus.endInjection(begin_s + 1);
  }
  for (const double begin_s : {0.0, 60.0, 120.0}) {
    const Eigen::VectorXd density = bolus.densities(begin_s + bolus.arrival_s()[14]);
    EXPECT_NEAR(density[14], 0.5, 1e-12);
    EXPECT_GT(density[10], 0.9);
    EXPECT_LT(density[18], 0.1);
    EXPECT_LT(bolus.densities(begin_s + 30).maxCoeff(), 1e-9);
  }
}

TEST(Bolus, DensitiesAddUpToTheUndilutedAgent) {
  const BolusSettings one = settings();
  Bolus first(line(), onDemand()), second(line(), onDemand()), both(line(), onDemand());
  for (Bolus* bolus : {&first, &both}) bolus->beginInjection(0), bolus->endInjection(1);
  for (Bolus* bolus : {&second, &both}) bolus->beginInjection(2.5), bolus->endInjection(3.5);
  bool cut = false;
  for (double t = 0; t < 8; t += 0.1) {
    const Eigen::VectorXd sum = first.densities(t) + second.densities(t);
    EXPECT_EQ(both.densities(t), sum.cwiseMin(1.0).eval());
    cut = cut || sum.maxCoeff() > 1;
  }
  EXPECT_TRUE(cut);
  // The injection of the settings is one of them.
  Bolus planned(line(), one);
  planned.beginInjection(30);
  EXPECT_EQ(planned.densities(20), Bolus(line(), one).densities(20));
  EXPECT_NEAR(planned.densities(30 + planned.arrival_s()[14])[14], 0.5, 1e-6);
}

TEST(SimulatedPatient, CarriesInjectionsOnDemandIntoTheScene) {
  SimulatedPatientSettings look;
  look.bolus = onDemand();
  SimulatedPatient patient(line(), look);
  const auto most = [&](double time_s) { return patient.scene(Pose::Identity(), time_s).densities->maxCoeff(); };
  EXPECT_EQ(most(1), 0);
  patient.beginInjection(1);
  EXPECT_GT(most(2), 0.99);
  patient.endInjection(3);
  EXPECT_LT(most(30), 1e-6);
}

TEST(SimulatedPatient, FillsAPartOfTheBranchesAndCarriesInjectionsIntoThoseOnly) {
  const VesselTree tree = readVesselTree(exampleData("hepatic-tace/tree.csv"));
  SimulatedPatientSettings half;
  half.filling.filled = 0.5;
  const auto densities = [&](const SimulatedPatientSettings& settings) {
    return SimulatedPatient(tree, settings).scene(Pose::Identity(), 5).densities;
  };
  EXPECT_FALSE(densities({})) << "a tree that is full needs none";
  const auto filled = densities(half);
  ASSERT_TRUE(filled);
  double length_m = 0;
  for (const auto& branch : tree.branches()) {
    // Of its ends a branch shares the points with its neighbours, of which others may be filled.
    bool whole = true;
    for (const int i : branch) whole = whole && (*filled)[i] > 0;
    for (std::size_t k = 1; k + 1 < branch.size(); ++k) EXPECT_EQ((*filled)[branch[k]], whole ? 1 : 0);
    for (std::size_t k = 1; whole && k < branch.size(); ++k) {
      length_m += (tree.points().col(branch[k]) - tree.points().col(branch[k - 1])).norm();
    }
  }
  EXPECT_NEAR(length_m / tree.length(), 0.5, 0.1) << "as near as whole branches come";
  EXPECT_EQ(*filled, *densities(half)) << "the same seed";
  int others = 0;  // Of a small tree some seeds fill the same.
  for (int seed = 2; seed < 10; ++seed) {
    SimulatedPatientSettings other = half;
    other.fluoroscopy.seed = seed;
    others += *filled != *densities(other);
  }
  EXPECT_GT(others, 3);
  SimulatedPatientSettings without = half;
  without.filling = {1, 0.3};
  EXPECT_LT(densities(without)->minCoeff(), 1);
  half.bolus.enabled = true;
  EXPECT_EQ((*densities(half)).cwiseProduct(*filled), *densities(half));
  EXPECT_GT(densities(half)->maxCoeff(), 0);
}

TEST(Bolus, NeedsRadiiAndSoundSettings) {
  const VesselTree tree = line();
  EXPECT_THROW(Bolus(VesselTree(tree.points(), tree.parents()), settings()), InputError);
  BolusSettings wrong = settings();
  wrong.wash_in_s = -1;
  EXPECT_THROW(Bolus(tree, wrong), InputError);
}

}  // namespace
}  // namespace angio::test
