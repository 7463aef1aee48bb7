// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/simulated_catheter.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "angio/geometry/se3.hpp"
#include "angio/simulation/nodes.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/types/channels.hpp"

namespace angio::test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// A straight vessel of 100 mm along z that splits into two of 60 mm, 30 deg to +x and to -x, after `shared_mm` in which
// the lines of both still go straight on.
VesselTree fork(double radius_m = 2e-3, int shared_mm = 0) {
  std::vector<Eigen::Vector3d> points;
  std::vector<int> parents;
  const auto grow = [&](int parent, Eigen::Vector3d from, const Eigen::Vector3d& step, int count) {
    for (int i = 1; i <= count; ++i) {
      points.push_back(from + i * step);
      parents.push_back(parent);
      parent = static_cast<int>(points.size()) - 1;
    }
    return parent;
  };
  points.emplace_back(0, 0, 0);
  parents.push_back(-1);
  const int split = grow(0, points.front(), {0, 0, 1e-3}, 100);
  const double s = 1e-3 * std::sin(degToRad(30)), c = 1e-3 * std::cos(degToRad(30));
  const Eigen::Vector3d parting(0, 0, 0.1 + 1e-3 * shared_mm);
  for (const double side : {s, -s}) {
    grow(grow(split, {0, 0, 0.1}, {0, 0, 1e-3}, shared_mm), parting, {side, 0, c}, 60);
  }
  Eigen::Matrix3Xd matrix(3, points.size());
  for (std::size_t i = 0; i < points.size(); ++i) matrix.col(static_cast<Eigen::Index>(i)) = points[i];
  return VesselTree(matrix, parents, std::vector<std::optional<double>>(points.size(), radius_m));
}

CatheterCommand catheterCommand(std::int64_t sequence, double insertion_m_per_s, double roll_rad_per_s = 0,
                                double bend_rad_per_s = 0, std::int64_t time_us = 0) {
  CatheterCommand c;
  c.time_us = time_us;
  c.sequence = sequence;
  c.valid_for_us = 1'000'000;
  c.insertion_speed_m_per_s = insertion_m_per_s;
  c.roll_speed_rad_per_s = roll_rad_per_s;
  c.bend_speed_rad_per_s = bend_rad_per_s;
  return c;
}

// Sends one command for as long as it takes, a second at a time.
void drive(SimulatedCatheter& catheter, double duration_s, double insertion_m_per_s, double roll_rad_per_s = 0,
           double bend_rad_per_s = 0) {
  std::int64_t now_us = catheter.state().time_us;
  for (double left_s = duration_s; left_s > 1e-9; left_s -= 0.5) {
    catheter.obey(catheterCommand(now_us / 1000 + 1, insertion_m_per_s, roll_rad_per_s, bend_rad_per_s, now_us),
                  now_us);
    now_us += std::llround(1e6 * std::min(left_s, 0.5));
    catheter.advance(now_us);
    CatheterCommand rest = catheterCommand(now_us / 1000, 0);
    catheter.obey(rest, now_us);
  }
}

TEST(SimulatedCatheter, StandsStillWithoutCommandsAndWhenTheyRunOut) {
  SimulatedCatheter catheter(fork(), {}, {0, 0.03}, 0);
  catheter.advance(5'000'000);
  EXPECT_EQ(catheter.truth().path_m, 0.03);
  CatheterCommand c = catheterCommand(1, 0.01, 0, 0, 5'000'000);
  c.valid_for_us = 200'000;
  catheter.obey(c, 5'000'000);
  catheter.advance(60'000'000);
  EXPECT_NEAR(catheter.state().insertion_m, 0.03 + 0.002, 1e-12);
  EXPECT_EQ(catheter.state().insertion_speed_m_per_s, 0);
}

TEST(SimulatedCatheter, IgnoresWhatMustNotMoveIt) {
  SimulatedCatheter catheter(fork(), {}, {0, 0.03}, 0);
  catheter.obey(catheterCommand(1, kNan), 0);
  catheter.obey(catheterCommand(2, 0, kNan), 0);
  catheter.obey(catheterCommand(3, 0, 0, std::numeric_limits<double>::infinity()), 0);
  CatheterCommand c = catheterCommand(4, 0.01);
  for (const std::int64_t validity : {std::int64_t{0}, std::int64_t{-5}, std::int64_t{1'000'001}}) {
    c.valid_for_us = validity;
    catheter.obey(c, 0);
  }
  catheter.advance(1'000'000);
  EXPECT_EQ(catheter.state().insertion_m, 0.03);
  EXPECT_EQ(catheter.ignored().not_finite, 3);
  EXPECT_EQ(catheter.ignored().bad_validity, 3);
  catheter.obey(catheterCommand(8, 0.01, 0, 0, 699'999), 1'000'000);
  catheter.obey(catheterCommand(8, 0.01, 0, 0, 1'100'001), 1'000'000);
  EXPECT_EQ(catheter.ignored().too_old, 2);
  catheter.obey(catheterCommand(8, 4, 0, 0, 1'000'000), 1'000'000);  // Millimetres for metres ...
  catheter.obey(catheterCommand(8, 0, 120, 0, 1'000'000), 1'000'000);
  catheter.obey(catheterCommand(8, 0, 0, 60, 1'000'000), 1'000'000);  // ... and degrees for radians.
  EXPECT_EQ(catheter.ignored().wrong_unit, 3);
  catheter.advance(1'000'000);
  EXPECT_EQ(catheter.state().insertion_m, 0.03);
  catheter.obey(catheterCommand(9, 0.01, 0, 0, 1'000'000), 1'000'000);
  catheter.obey(catheterCommand(9, -0.01, 0, 0, 1'000'000), 1'000'000);
  catheter.obey(catheterCommand(8, -0.01, 0, 0, 1'000'000), 1'000'000);
  EXPECT_EQ(catheter.ignored().out_of_sequence, 2);
  catheter.advance(1'500'000);
  EXPECT_GT(catheter.state().insertion_m, 0.03);
}

TEST(SimulatedCatheter, MovesTheSameHoweverOftenItIsAsked) {
  const VesselTree tree = test::branchingTree(3);
  SimulatedCatheter often(tree, {}, {0, 0.02}, 0), seldom(tree, {}, {0, 0.02}, 0);
  test::Random random(5);
  std::int64_t now_us = 0;
  for (int i = 1; i < 60; ++i) {
    const CatheterCommand c =
        catheterCommand(i, random.uniform(-0.01, 0.03), random.uniform(-3, 3), random.uniform(-1, 1), now_us);
    often.obey(c, now_us);
    seldom.obey(c, now_us);
    const std::int64_t next_us = now_us + static_cast<std::int64_t>(random.uniform(1, 1'200'000));
    while (now_us < next_us)
      often.advance(now_us = std::min(next_us, now_us + 1 + static_cast<std::int64_t>(random.uniform(0, 20'000))));
    seldom.advance(next_us);
    ASSERT_EQ(often.truth().path_m, seldom.truth().path_m);
    ASSERT_EQ(often.truth().roll_rad, seldom.truth().roll_rad);
    ASSERT_EQ(often.state().insertion_force_n, seldom.state().insertion_force_n);
  }
}

// Thinned centrelines often run together beyond the point where they are said to fork.
class SimulatedCatheterAtAFork : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(SharedMm, SimulatedCatheterAtAFork, testing::Values(0, 5));

TEST_P(SimulatedCatheterAtAFork, EntersTheBranchThatItsTipPointsTo) {
  const VesselTree tree = fork(2e-3, GetParam());
  const TreeTopology map(tree);
  const TreeFrame frame = map.frame({0, 0.1});
  int tried = 0;
  for (int k = 0; k < 12; ++k) {
    CatheterSettings settings;
    settings.roll_zero_deg = 30.0 * k + 10;
    const double roll = degToRad(settings.roll_zero_deg);
    const double towards_x = (std::cos(roll) * frame.normal + std::sin(roll) * frame.binormal).x();
    SimulatedCatheter catheter(tree, settings, {0, 0.08}, 0);
    drive(catheter, 4, 0.01);
    const int branch = catheter.truth().tip.branch;
    ASSERT_NE(branch, 0);
    EXPECT_GT(map.point({branch, 15e-3}).x() * towards_x, 0) << "roll " << settings.roll_zero_deg;
    // Pulled back in front of the fork and turned by half a turn, it takes the other one; but across the fork's plane
    // the wind-up, some 15 deg, decides.
    if (std::abs(towards_x) < 0.6) continue;
    drive(catheter, 5, -0.01);
    ASSERT_EQ(catheter.truth().tip.branch, 0);
    drive(catheter, 2, 0, kPi / 2);
    drive(catheter, 2, 0, 0.25);  // What backlash and wind-up keep back.
    drive(catheter, 5, 0.01);
    EXPECT_NE(catheter.truth().tip.branch, branch);
    ++tried;
  }
  EXPECT_GE(tried, 6);
}

TEST(SimulatedCatheter, LosesBacklashSlackAndFrictionWhenItTurnsBack) {
  CatheterSettings settings;
  settings.insertion_backlash_mm = 1;
  SimulatedCatheter catheter(fork(), settings, {0, 0.03}, 0);
  drive(catheter, 2, 0.01);
  const double pushed = catheter.state().insertion_m - catheter.truth().path_m;
  EXPECT_GE(pushed, 0.5e-3);  // Half of the backlash, then friction.
  EXPECT_GT(catheter.state().insertion_force_n, 0);
  drive(catheter, 2, -0.01);
  EXPECT_LE(catheter.state().insertion_m - catheter.truth().path_m, -0.5e-3);
  EXPECT_LT(catheter.state().insertion_force_n, 0);
}

TEST(SimulatedCatheter, BucklesAgainstTheEndAndSaysSo) {
  SimulatedCatheter catheter(fork(), {}, {1, 0.055}, 0);
  drive(catheter, 3, 0.02);
  const CatheterTruth truth = catheter.truth();
  EXPECT_NEAR(truth.tip.arc_m, 0.06, 1e-3);
  EXPECT_TRUE(truth.buckled);
  EXPECT_TRUE(truth.touches_wall);
  EXPECT_GE(truth.wall_contacts, 1);
  EXPECT_EQ(catheter.state().insertion_force_n, CatheterSettings().buckling_force_n);
}

TEST(SimulatedCatheter, GoesNoFurtherThanTheLumenIsWide) {
  SimulatedCatheter catheter(fork(0.3e-3), {}, {0, 0.03}, 0);  // Narrower than its own 0.35 mm.
  drive(catheter, 2, 0.01);
  EXPECT_EQ(catheter.truth().path_m, 0.03);
}

TEST(SimulatedCatheter, ItsShapeStaysInTheLumenAndMovesWithTheTissue) {
  const VesselTree tree = fork();
  SimulatedCatheter catheter(tree, {}, {0, 0.09}, 0);
  drive(catheter, 4, 0.01);
  const Device device = catheter.device(tree.points());
  device.check();
  for (Eigen::Index i = 0; i < device.points.cols(); ++i) {
    const double off = (tree.points().colwise() - device.points.col(i)).colwise().norm().minCoeff();
    EXPECT_LE(off, std::hypot(2e-3 - 0.35e-3, 0.5e-3) + 1e-9);  // Tree points are 1 mm apart.
  }
  const Eigen::Vector3d shift(1e-3, 2e-3, 3e-3);
  const Device moved = catheter.device(tree.points().colwise() + shift);
  EXPECT_LT(((moved.points - device.points).colwise() - shift).norm(), 1e-12);
  EXPECT_LT((catheter.truth().tip_model - device.points.rightCols<1>()).norm(), 1e-12);
}

CatheterSettings elasticCatheter(double roll_zero_deg = 0) {
  CatheterSettings settings;
  settings.elastic.emplace();
  settings.roll_zero_deg = roll_zero_deg;
  return settings;
}

TEST(ElasticCatheter, MovesTheSameHoweverOftenItIsAsked) {
  SimulatedCatheter often(fork(), elasticCatheter(40), {0, 0.06}, 0), seldom(fork(), elasticCatheter(40), {0, 0.06}, 0);
  for (std::int64_t now_us = 0, k = 1; now_us < 3'000'000; now_us += 500'000, ++k) {
    for (auto* catheter : {&often, &seldom}) catheter->obey(catheterCommand(k, 0.02, 0.5, 0.3, now_us), now_us);
    for (int part = 1; part <= 50; ++part) often.advance(now_us + part * 10'000);
    seldom.advance(now_us + 500'000);
    ASSERT_EQ(often.truth().tip_model, seldom.truth().tip_model);
    ASSERT_EQ(often.state().insertion_force_n, seldom.state().insertion_force_n);
  }
  EXPECT_GT(often.truth().path_m, 0.1);
}

TEST(ElasticCatheter, EntersTheBranchThatItsTipPointsTo) {
  const VesselTree tree = fork();
  const TreeTopology map(tree);
  for (const double zero_deg : {0.0, 90.0, 180.0, 270.0}) {
    SimulatedCatheter catheter(tree, elasticCatheter(zero_deg), {0, 0.08}, 0);
    const TreeFrame frame = map.frame({0, 0.08});
    const double roll = degToRad(zero_deg);
    const double towards_x = (std::cos(roll) * frame.normal + std::sin(roll) * frame.binormal).x();
    EXPECT_NEAR(std::remainder(catheter.truth().roll_rad - roll, 2 * kPi), 0, 0.05);
    if (std::abs(towards_x) < 0.5) continue;
    drive(catheter, 4, 0.01);
    ASSERT_NE(catheter.truth().tip.branch, 0);
    EXPECT_GT(map.point({catheter.truth().tip.branch, 15e-3}).x() * towards_x, 0);
  }
}

// What the drive pushes with is never much above what it can, however long it pushes: the catheter bulges outside, and
// pulled back it first gives that back.
TEST(ElasticCatheter, PushesAgainstTheEndWithWhatTheDriveCanAndNoMore) {
  SimulatedCatheter catheter(fork(0.6e-3), elasticCatheter(), {1, 0.055}, 0);  // In a wider one it would fold.
  drive(catheter, 3, 0.02);
  const CatheterTruth truth = catheter.truth();
  EXPECT_TRUE(truth.buckled);
  EXPECT_TRUE(truth.touches_wall);
  const double most_n = CatheterSettings().buckling_force_n;
  EXPECT_GT(catheter.state().insertion_force_n, most_n);
  EXPECT_LT(catheter.state().insertion_force_n, 1.5 * most_n);  // One step of 0.6 mm more.
  EXPECT_GT(truth.tip_force_n, 0.3 * most_n);
  EXPECT_GE(truth.max_tip_force_n, truth.tip_force_n);
  drive(catheter, 4, -0.02);
  EXPECT_LT(catheter.state().insertion_force_n, 0.1);  // Its bends still push it out.
  EXPECT_LT(catheter.truth().tip_force_n, 0.1);
}

// The stiff shaft is still outside the branch's bend where the soft part is long, and is in it where that is short.
TEST(ElasticCatheter, ALongSoftPartTakesABendWithLess) {
  const auto most_n = [](double soft_length_mm) {
    CatheterSettings settings = elasticCatheter();
    settings.elastic->shaft_bending_n_mm2 = 30;
    settings.elastic->soft_length_mm = soft_length_mm;
    SimulatedCatheter catheter(fork(), settings, {0, 0.08}, 0);
    drive(catheter, 4, 0.01);
    EXPECT_NE(catheter.truth().tip.branch, 0);
    return catheter.state().insertion_force_n;
  };
  EXPECT_GT(most_n(10), 1.5 * most_n(200));
}

TEST(ElasticCatheter, ItsShapeMovesWithTheTissue) {
  const VesselTree tree = fork();
  SimulatedCatheter catheter(tree, elasticCatheter(), {0, 0.09}, 0);
  drive(catheter, 2, 0.01);
  const Device device = catheter.device(tree.points());
  device.check();
  EXPECT_EQ(device.points.col(0), tree.points().col(0));
  EXPECT_EQ(device.points.rightCols<1>(), catheter.truth().tip_model);
  const Eigen::Vector3d shift(1e-3, 2e-3, 3e-3);
  const Device moved = catheter.device(tree.points().colwise() + shift);
  EXPECT_LT(((moved.points - device.points).colwise() - shift).norm(), 1e-12);
}

TEST(SimulatedCatheter, RefusesAStartThatIsNoPlaceOfTheTree) {
  EXPECT_NE(test::refusalOf([] { SimulatedCatheter(fork(), {}, {7, 0}, 0); }).find("chain"), std::string::npos);
  EXPECT_NE(test::refusalOf([] { SimulatedCatheter(fork(), {}, {0, 0.2}, 0); }).find("arc_m"), std::string::npos);
}

TEST(SimulatedCatheterNode, ObeysAndReportsOnTheBus) {
  const auto bus = openBus("memq://");
  SimulatedCatheterNode node(*bus, fork(), {}, {0, 0.03}, 0);
  LatestMessage<CatheterState> states(*bus, kCatheterStateChannel);
  publish(*bus, kCatheterCommandChannel, catheterCommand(1, 0.01));
  bus->handle(std::chrono::milliseconds(0));
  node.listen(0);
  node.report(500'000);
  bus->handle(std::chrono::milliseconds(0));
  ASSERT_TRUE(states.peek());
  EXPECT_EQ(states.peek()->sequence, 1);
  EXPECT_NEAR(states.peek()->insertion_m, 0.035, 1e-12);
}

}  // namespace
}  // namespace angio::test
