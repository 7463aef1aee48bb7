// SPDX-License-Identifier: GPL-2.0-or-later
// Elastic rods against closed forms of beams and columns.
#include "angio/rod/elastic_rod.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "tubes.hpp"

namespace angio::test {
namespace {

constexpr double kLength_m = 0.1, kBending_n_m2 = 1e-4;

// The same along all its length, straight, without friction, every 2 mm a point.
RodSettings plainRod() {
  RodSettings settings;
  settings.shaft_bending_n_m2 = settings.tip_bending_n_m2 = kBending_n_m2;
  settings.stretching_n = 1e4;
  settings.friction = 0;
  settings.spacing_m = settings.tip_spacing_m = 2e-3;
  return settings;
}

// In a vessel so wide that nothing touches it.
ElasticRod freeRod(const RodSettings& settings = plainRod()) {
  return ElasticRod(Lumen(straightTube(0.2, 0.5, 5e-3)), settings, {{0, kLength_m}});
}

Eigen::Vector3d tipOf(const ElasticRod& rod) { return rod.shape().points.rightCols<1>(); }

TEST(ElasticRod, BendsAsACantilever) {
  ElasticRod rod = freeRod();
  constexpr double kForce_n = 1e-3;
  rod.load({kForce_n, 0, 0});
  rod.move({});
  EXPECT_TRUE(rod.effort().at_rest);
  const double closed_m = kForce_n * std::pow(kLength_m, 3) / (3 * kBending_n_m2);  // 3.3 mm
  expectClosedForm("cantilever", tipOf(rod).x(), closed_m);
}

TEST(ElasticRod, BucklesAtEulersLoad) {
  const double critical_n = kPi * kPi * kBending_n_m2 / (4 * kLength_m * kLength_m);
  constexpr double kAside_n = 1e-5;
  for (const double share : {0.5, 0.8, 0.95}) {
    ElasticRod rod = freeRod();
    rod.load({kAside_n, 0, -share * critical_n});
    rod.move({});
    const double k = std::sqrt(share * critical_n / kBending_n_m2);  // Timoshenko and Gere, a column with a side load.
    const double closed_m = kAside_n * (std::tan(k * kLength_m) - k * kLength_m) / (k * share * critical_n);
    expectClosedForm("column at " + std::to_string(share) + " of Euler's load", tipOf(rod).x(), closed_m);
  }
  // Beyond it the rod is an elastica: K(k) by the load, and the tip 2 k / sqrt(P / EI) aside (Love, section 263).
  constexpr double kShare = 1.2;
  ElasticRod rod = freeRod();
  rod.load({kAside_n, 0, -kShare * critical_n});
  for (int k = 0; k < 20 && (k == 0 || !rod.effort().at_rest); ++k) rod.move({});
  ASSERT_TRUE(rod.effort().at_rest);
  double low = 0, high = 0.9;
  while (high - low > 1e-9) {
    const double k = 0.5 * (low + high);
    (std::comp_ellint_1(k) < 0.5 * kPi * std::sqrt(kShare) ? low : high) = k;
  }
  const double closed_m = 2 * low / std::sqrt(kShare * critical_n / kBending_n_m2);
  expectClosedForm("elastica at 1.2 of Euler's load", tipOf(rod).x(), closed_m);
}

// A column longer than its buckling length winds itself along the wall of a cylinder as a helix of the pitch
// 2 pi sqrt(2 E I / F) and presses on it by r F^2 / 4 E I a metre (A. Lubinski, W. S. Althouse and J. L. Logan, Helical
// buckling of tubing sealed in packers, Journal of Petroleum Technology 14(6), 1962; R. F. Mitchell, Buckling behavior
// of well tubing, SPE Journal 22(5), 1982).
TEST(ElasticRod, BucklesInACylinderAsAHelix) {
  RodSettings settings = plainRod();
  settings.radius_m = 0.5e-3;
  settings.spacing_m = settings.tip_spacing_m = 3e-3;
  settings.stretching_n = 1000;
  settings.wall_pa = 1e7;
  settings.end_wall_m = 0;
  constexpr double kRoom_m = 2e-3, kForce_n = 1;
  ElasticRod rod(Lumen(straightTube(0.4, kRoom_m + settings.radius_m)), settings, {{0, 0.35}});
  for (int k = 1; k <= 20; ++k) {
    rod.load({1e-3, 0, -kForce_n * std::min(k / 15.0, 1.0)});
    rod.move({0, 0.02});
  }
  const Eigen::Matrix3Xd& points = rod.shape().points;
  const Eigen::Matrix3Xd wall_n = rod.forces().wall_n;
  // Where it winds evenly: the hand may change in the middle, and at both ends it comes off the wall.
  std::vector<double> turn_per_m, wall_n_per_m;
  for (Eigen::Index i = 2; i + 1 < points.cols(); ++i) {
    const double turn = std::atan2(points(1, i + 1), points(0, i + 1)) - std::atan2(points(1, i), points(0, i));
    turn_per_m.push_back(std::abs(std::remainder(turn, 2 * kPi)) / (points(2, i + 1) - points(2, i)));
    wall_n_per_m.push_back(wall_n.col(i).norm() / settings.spacing_m);
  }
  const auto middle = [](std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    return values[values.size() / 2];
  };
  const double pitch_m = 2 * kPi * std::sqrt(2 * kBending_n_m2 / kForce_n);
  expectClosedForm("helix: pitch", 2 * kPi / middle(turn_per_m), pitch_m);
  const double closed_n_per_m = kRoom_m * kForce_n * kForce_n / (4 * kBending_n_m2);
  expectClosedForm("helix: wall's force", middle(wall_n_per_m), closed_n_per_m);
}

// A bent tip without load is an arc and goes straight on behind it, towards the director.
TEST(ElasticRod, ATipIsBentAsItsShapeIs) {
  RodSettings settings = plainRod();
  settings.tip_spacing_m = 0.5e-3;
  ElasticRod rod = freeRod(settings);
  constexpr double kBend_rad = 1.2;
  for (int k = 0; k < 10; ++k) {
    rod.bend(kBend_rad * (k + 1) / 10);
    rod.move({});
  }
  ASSERT_TRUE(rod.effort().at_rest);
  EXPECT_LT(rod.effort().energy_j, 1e-9);
  const Eigen::Vector3d director = rod.shape().directors.col(0);
  const double aside_m = settings.bend_length_m / kBend_rad * (1 - std::cos(kBend_rad)) +
                         (settings.tip_length_m - 0.5 * settings.bend_length_m) * std::sin(kBend_rad);
  EXPECT_NEAR(tipOf(rod).head<2>().norm(), aside_m, 0.01 * aside_m);  // Points are a twelfth of the arc apart.
  EXPECT_NEAR(tipOf(rod).head<2>().normalized().dot(director.head<2>()), 1, 1e-6);
  // Turned by a quarter at its base, the tip is turned by as much: nothing holds it.
  for (int k = 0; k < 10; ++k) rod.move({0, kPi / 20});
  const Eigen::Vector3d turned = rod.shape().directors.col(0);
  EXPECT_NEAR(turned.dot(director), 0, 1e-9);
  EXPECT_NEAR(director.cross(turned).z(), 1, 1e-9);
  EXPECT_NEAR(tipOf(rod).head<2>().normalized().dot(turned.head<2>()), 1, 1e-4);
}

// In and out over many points coming and going: without friction only the drive's place counts.
TEST(ElasticRod, ComesBackToWhereItWas) {
  RodSettings settings;
  settings.friction = 0;
  ElasticRod rod(Lumen(bentTube(0.06, 0.05, 1, 4e-3)), settings, {{0, 0.08}, 0.4});
  const Eigen::Vector3d before = tipOf(rod);
  const auto points = rod.shape().size();
  for (int k = 0; k < 30; ++k) rod.move({1e-3, 0.1});
  EXPECT_GT((tipOf(rod) - before).norm(), 20e-3);
  EXPECT_GT(rod.shape().size(), points + 5);
  for (int k = 0; k < 30; ++k) rod.move({-1e-3, -0.1});
  EXPECT_LT((tipOf(rod) - before).norm(), 0.2e-3);  // The first edge is cut elsewhere.
  EXPECT_NEAR(rod.inserted_m(), 0.08, 1e-12);
}

// A step of the drive of three edges is as good as many that are shorter than one: points come and go as they must.
TEST(ElasticRod, AStepMayBeLongerThanAnEdge) {
  RodSettings settings;
  settings.friction = 0;
  settings.spacing_m = settings.tip_spacing_m = 0.35e-3;
  const Lumen lumen(bentTube(0.02, 0.05, 0.4, 4e-3));
  ElasticRod at_once(lumen, settings, {{0, 0.03}, 0.4}), by_parts(lumen, settings, {{0, 0.03}, 0.4});
  for (const double in_m : {1e-3, 1e-3, -1e-3, -1e-3, -1e-3}) {
    at_once.move({in_m, 0});
    for (int k = 0; k < 10; ++k) by_parts.move({0.1 * in_m, 0});
    ASSERT_TRUE(at_once.shape().points.allFinite());
    EXPECT_GT(at_once.body().lengths_m.minCoeff(), 0.3 * settings.spacing_m);
    EXPECT_LT((tipOf(at_once) - tipOf(by_parts)).norm(), 20e-6);  // The first edge is cut elsewhere.
  }
}

// Wherever a bent tip points, pushed on it goes into the branch on that side and not into the wall between them.
TEST(ElasticRod, TakesTheBranchThatItsTipPointsTo) {
  RodSettings settings;
  settings.radius_m = 0.5e-3;
  settings.tip_length_m = 8e-3;
  settings.tip_bending_n_m2 = 5e-6;
  for (const double side : {1.0, -1.0}) {
    const VesselTree tree = forkedTube(0.06, 0.04, 0.5, 3e-3, 2e-3);
    ElasticRod rod(Lumen(tree), settings, {{0, 0.045}});
    const double towards_x = std::atan2(rod.shape().directors(1, 0), rod.shape().directors(0, 0));
    rod.bend(0.8);
    for (int k = 0; k < 16; ++k) rod.move({0, ((side > 0 ? 0 : kPi) - towards_x) / 16});
    for (int k = 0; k < 40; ++k) rod.move({1e-3, 0});
    EXPECT_GT(rod.tip().branch, 0);
    EXPECT_GT(rod.tip().arc_m, 15e-3);
    EXPECT_GT(side * tipOf(rod).x(), 5e-3);
    EXPECT_LT(rod.forces().tip_n, 0.2);
  }
}

}  // namespace
}  // namespace angio::test
