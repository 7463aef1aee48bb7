// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/rod/lumen.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/test/differences.hpp"
#include "angio/test/random.hpp"
#include "tubes.hpp"

namespace angio::test {
namespace {

TEST(Lumen, GapIsTheRoomBesideTheAxis) {
  const Lumen lumen(straightTube(0.1, 3e-3));
  const int tube = lumen.tubeAt({0, 0.05});
  const WallGap inside = lumen.gapNear(tube, {1e-3, 0, 0.05}, 0.5e-3);
  EXPECT_NEAR(inside.gap_m, 1.5e-3, 1e-12);
  EXPECT_NEAR(inside.gradient.x(), -1, 1e-12);
  EXPECT_NEAR(lumen.place(inside.tube, inside.weight).arc_m, 0.05, 1e-9);
  EXPECT_NEAR(lumen.gapNear(tube, {0, 4e-3, 0.05}, 0.5e-3).gap_m, -1.5e-3, 1e-12);
  // Its end is round.
  EXPECT_NEAR(lumen.gapNear(lumen.tubeAt({0, 0.1}), {0, 0, 0.104}, 0.5e-3).gap_m, -1.5e-3, 1e-9);
}

TEST(Lumen, DerivativesAreThoseOfDifferences) {
  const Lumen lumen(forkedTube(0.05, 0.04, 0.6, 3e-3, 2e-3));
  Random random(2);
  int beside = 0;
  for (int k = 0; k < 200; ++k) {
    const Eigen::Vector3d p = Eigen::Vector3d(0, 0, 0.05) + random.vector(5e-3);
    const int tube = lumen.tubeAt({0, 0.05});
    const WallGap gap = lumen.gapNear(tube, p, 0);
    const auto sameTube = [&](const Eigen::VectorXd& step) {
      return lumen.gapNear(tube, p + step, 0).tube == gap.tube;
    };
    constexpr double kStep_m = 1e-7;
    bool smooth = true;
    for (int axis = 0; axis < 3; ++axis) {
      for (const double s : {-kStep_m, kStep_m}) smooth = smooth && sameTube(s * Eigen::VectorXd::Unit(3, axis));
    }
    if (!smooth || gap.weight == 0 || gap.weight == 1) continue;
    ++beside;
    const auto value = [&](const Eigen::VectorXd& step) {
      return Eigen::VectorXd::Constant(1, lumen.gapNear(tube, p + step, 0).gap_m);
    };
    const auto slope = [&](const Eigen::VectorXd& step) { return lumen.gapNear(tube, p + step, 0).gradient; };
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(3);
    EXPECT_LT((centralDifferences(value, zero, kStep_m).transpose() - gap.gradient).norm(), 1e-6);
    EXPECT_LT((centralDifferences(slope, zero, kStep_m) + gap.curvature).norm(), 1e-6 * gap.curvature.norm() + 1e-3);
  }
  EXPECT_GT(beside, 50);
}

// Two vessels that cross within 1 mm of each other: what is in one of them does not see the other.
TEST(Lumen, VesselsThatOnlyTouchStayApart) {
  std::vector<Eigen::Vector3d> points;
  std::vector<int> parents;
  // A hairpin: up along z, over at the top, and back down beside itself.
  for (int k = 0; k <= 60; ++k) points.emplace_back(0, 0, 1e-3 * k);
  for (int k = 1; k <= 3; ++k) points.emplace_back(1e-3 * k, 0, 60e-3);
  for (int k = 1; k <= 60; ++k) points.emplace_back(3e-3, 0, 60e-3 - 1e-3 * k);
  for (std::size_t k = 0; k < points.size(); ++k) parents.push_back(static_cast<int>(k) - 1);
  const Lumen lumen(treeOf(points, parents, 2e-3));
  const WallGap gap = lumen.gapNear(lumen.tubeAt({0, 0.02}), {2.5e-3, 0, 0.02}, 0.2e-3);
  EXPECT_NEAR(gap.gap_m, -0.7e-3, 1e-9);
  EXPECT_NEAR(gap.gradient.x(), -1, 1e-9);
}

TEST(Lumen, NeedsAllRadii) {
  EXPECT_THROW(Lumen(VesselTree(straightTube(0.1, 3e-3).points(), straightTube(0.1, 3e-3).parents())), InputError);
}

}  // namespace
}  // namespace angio::test
