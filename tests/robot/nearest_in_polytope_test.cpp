// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/robot/nearest_in_polytope.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/random.hpp"

namespace angio::test {
namespace {

CArmJoints randomVector(test::Random& random, double scale) {
  return CArmJoints::NullaryExpr([&](Eigen::Index) { return scale * random.normal(); });
}

// A box of +-1 and some faces that all leave the origin inside.
Polytope randomPolytope(test::Random& random, int faces) {
  Polytope p;
  p.normals.setZero(10 + faces, kCArmJointCount);
  p.bounds.setOnes(10 + faces);
  for (int i = 0; i < kCArmJointCount; ++i) {
    p.normals(2 * i, i) = 1;
    p.normals(2 * i + 1, i) = -1;
  }
  for (int k = 10; k < 10 + faces; ++k) {
    p.normals.row(k) = randomVector(random, 1).transpose();
    // Some pass through the start, as a joint at its end does.
    p.bounds[k] = random.uniform(0, 1) < 0.3 ? 0 : random.uniform(0, 1);
  }
  return p;
}

// Every set of up to five faces, one after the other: the nearest point of their intersection that is inside.
CArmJoints byBruteForce(const CArmJoints& wanted, const Polytope& p) {
  CArmJoints best = CArmJoints::Zero();
  double best_distance = std::numeric_limits<double>::infinity();
  for (unsigned set = 0; set < 1u << p.size(); ++set) {
    const int count = __builtin_popcount(set);
    if (count > kCArmJointCount) continue;
    Eigen::MatrixXd A(count, kCArmJointCount);
    Eigen::VectorXd b(count);
    for (int k = 0, row = 0; k < p.size(); ++k) {
      if (!(set >> k & 1u)) continue;
      A.row(row) = p.normals.row(k);
      b[row++] = p.bounds[k];
    }
    CArmJoints x = wanted;
    if (count > 0) {
      const auto lu = (A * A.transpose()).fullPivLu();
      if (!lu.isInvertible()) continue;
      x -= A.transpose() * lu.solve(A * wanted - b);
    }
    const bool inside = ((p.normals * x - p.bounds).array() <= 1e-9).all();
    if (inside && (x - wanted).norm() < best_distance) {
      best_distance = (x - wanted).norm();
      best = x;
    }
  }
  return best;
}

TEST(NearestInPolytope, IsWhatBruteForceFinds) {
  test::Random random(1);
  for (int i = 0; i < 60; ++i) {
    const Polytope p = randomPolytope(random, 3);
    const CArmJoints wanted = randomVector(random, 1.5);
    const CArmJoints x = nearestInPolytope(wanted, p, CArmJoints::Zero());
    EXPECT_LT((x - byBruteForce(wanted, p)).norm(), 1e-9) << i;
  }
}

TEST(NearestInPolytope, StaysInsideAndIsNeverFurtherThanTheStart) {
  test::Random random(2);
  for (int i = 0; i < 5000; ++i) {
    const Polytope p = randomPolytope(random, 8);
    const CArmJoints wanted = randomVector(random, 3);
    const CArmJoints x = nearestInPolytope(wanted, p, CArmJoints::Zero());
    EXPECT_LE((p.normals * x - p.bounds).maxCoeff(), 1e-12);
    EXPECT_LE((x - wanted).norm(), wanted.norm() + 1e-12);
    // Nearest: no feasible way leads nearer (Kolmogorov's criterion against points inside).
    for (int k = 0; k < 20; ++k) {
      const CArmJoints other = nearestInPolytope(randomVector(random, 2), p, CArmJoints::Zero());
      EXPECT_LE((wanted - x).dot(other - x), 1e-9);
    }
  }
}

}  // namespace
}  // namespace angio::test
