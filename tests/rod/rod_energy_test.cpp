// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/rod/rod_energy.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "angio/test/differences.hpp"
#include "angio/test/random.hpp"
#include "banded_system.hpp"
#include "wall_friction.hpp"

namespace angio::test {
namespace {

struct Rod {
  RodShape shape;
  RodBody body;
};

// A rod of 12 points some 3 mm apart, bent and twisted at random, each point with a section of its own.
Rod randomRod(unsigned seed) {
  Random random(seed);
  constexpr int kPoints = 12;
  Eigen::Matrix3Xd points(3, kPoints);
  for (int i = 0; i < kPoints; ++i) points.col(i) = Eigen::Vector3d(0, 0, 3e-3 * i) + random.vector(0.5e-3);
  Rod rod{untwistedRod(points, Eigen::Vector3d::UnitX()), {}};
  rod.body.lengths_m = Eigen::VectorXd::Constant(kPoints - 1, 3e-3);
  for (int i = 0; i < kPoints; ++i) {
    const double bending = random.uniform(1e-5, 3e-4);
    rod.body.sections.push_back({random.uniform(50, 300), bending, random.uniform(0.5, 2) * bending,
                                 Eigen::Vector2d(random.uniform(-40, 40), random.uniform(-40, 40))});
  }
  Eigen::VectorXd turns = Eigen::VectorXd::Zero(rod.shape.freedoms());
  for (Eigen::Index j = 1; j + 1 < kPoints; ++j) turns[RodShape::turnOf(j)] = random.uniform(-0.8, 0.8);
  rod.shape = rolled(moved(rod.shape, turns), 0.4);
  return rod;
}

Eigen::VectorXd gradientOf(const RodShape& shape, const RodBody& body) {
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(shape.freedoms());
  elasticEnergy(shape, body, &gradient);
  return gradient;
}

TEST(RodEnergy, GradientIsThatOfDifferences) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Rod rod = randomRod(seed);
    const auto energy = [&](const Eigen::VectorXd& step) {
      return Eigen::VectorXd::Constant(1, elasticEnergy(moved(rod.shape, step), rod.body));
    };
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(rod.shape.freedoms());
    const Eigen::VectorXd numeric = centralDifferences(energy, zero, 1e-7).transpose();
    const Eigen::VectorXd analytic = gradientOf(rod.shape, rod.body);
    // Steps of 1e-7 m in 3 mm leave (1e-7 / 3e-3)^2 of the force, and energies of 0.1 J are rounded to 1e-17.
    EXPECT_LT((numeric - analytic).norm(), 1e-6 * analytic.norm()) << "seed " << seed;
  }
}

TEST(RodEnergy, RigidMotionsDoNotChangeIt) {
  Random random(3);
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const Rod rod = randomRod(seed);
    const Pose T = expSE3(random.twist(0.1, 2));
    RodShape elsewhere = rod.shape;
    elsewhere.points = (T.linear() * rod.shape.points).colwise() + T.translation();
    elsewhere.directors = T.linear() * rod.shape.directors;
    const double energy = elasticEnergy(rod.shape, rod.body);
    EXPECT_NEAR(elasticEnergy(elsewhere, rod.body), energy, 1e-12 * energy);
  }
}

// Where nothing is strained Gauss-Newton leaves nothing out.
TEST(RodEnergy, SecondDerivativesAreExactWithoutLoad) {
  Rod rod = randomRod(4);
  const Eigen::Index n = rod.shape.size();
  for (Eigen::Index j = 0; j + 1 < n; ++j) rod.body.lengths_m[j] = rod.shape.edge(j).norm();
  rod.shape.twists.setZero();
  rod.shape = untwistedRod(rod.shape.points, Eigen::Vector3d::UnitY());
  // The natural curvature that this shape has: bending towards the director and across it, by the turn at each point.
  for (Eigen::Index i = 1; i + 1 < n; ++i) {
    const Eigen::Vector3d before = rod.shape.edge(i - 1).normalized(), along = rod.shape.edge(i).normalized();
    const double angle = std::atan2(before.cross(along).norm(), before.dot(along));
    const Eigen::Vector3d binormal = before.cross(along).normalized(), director = rod.shape.directors.col(i);
    rod.body.sections[static_cast<std::size_t>(i)].curvature_per_m =
        angle / rod.body.share_m(i) * Eigen::Vector2d(along.cross(director).dot(binormal), -director.dot(binormal));
  }
  EXPECT_LT(elasticEnergy(rod.shape, rod.body), 1e-15);
  BandedSystem hessian(rod.shape.freedoms());
  hessian.clear(1);
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(rod.shape.freedoms());
  elasticEnergy(rod.shape, rod.body, &gradient, &hessian);
  ASSERT_TRUE(hessian.factorise());
  const auto slope = [&](const Eigen::VectorXd& step) { return gradientOf(moved(rod.shape, step), rod.body); };
  const Eigen::MatrixXd numeric = centralDifferences(slope, Eigen::VectorXd::Zero(gradient.size()), 1e-7);
  Random random(8);
  Eigen::VectorXd right(gradient.size());
  for (double& x : right) x = random.normal();
  const Eigen::VectorXd solved = hessian.solve(right), dense = numeric.ldlt().solve(right);
  EXPECT_LT((solved - dense).norm(), 1e-3 * dense.norm());  // The matrix's condition, some 1e4, times 1e-8 ...
}

TEST(RodEnergy, SlidingCostsWhatTheBoundSays) {
  Rod rod = randomRod(5);
  rod.shape.turned.setZero();
  std::vector<SlidingPoint> points;
  Random random(6);
  for (const Eigen::Index i : {Eigen::Index{2}, Eigen::Index{6}, rod.shape.size() - 1}) {
    const Eigen::Vector3d along = rod.shape.edge(i - 1).normalized();
    points.push_back(
        {i, rod.shape.points.col(i) + random.vector(2e-5), along.cross(random.direction()).normalized(), along, 0.1});
  }
  constexpr double kRadius_m = 0.8e-3;
  const auto energy = [&](const Eigen::VectorXd& step) {
    return Eigen::VectorXd::Constant(1, slidingEnergy(moved(rod.shape, step), points, kRadius_m, nullptr, nullptr));
  };
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(rod.shape.freedoms());
  slidingEnergy(rod.shape, points, kRadius_m, &gradient, nullptr);
  const Eigen::VectorXd numeric = centralDifferences(energy, Eigen::VectorXd::Zero(gradient.size()), 1e-9).transpose();
  EXPECT_LT((numeric - gradient).norm(), 1e-5 * gradient.norm());
  // Far from where it was, a point is held by the bound, whatever way it went.
  points.front().from += 1e-3 * points.front().along;
  EXPECT_NEAR(friction_n(rod.shape, points.front(), kRadius_m).norm(), 0.1, 1e-4);
}

}  // namespace
}  // namespace angio::test
