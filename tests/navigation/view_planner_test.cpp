// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/view_planner.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/geometry/se3.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

// 100 mm along +P (the beam of the frontal view), then 100 mm along +S.
VesselTree corner() {
  constexpr int kHalf = 50;
  Eigen::Matrix3Xd points(3, 2 * kHalf + 1);
  std::vector<int> parents;
  for (int i = 0; i <= 2 * kHalf; ++i) {
    points.col(i) << 0, 2e-3 * std::min(i, kHalf), 2e-3 * std::max(i - kHalf, 0);
    parents.push_back(i - 1);
  }
  return VesselTree(points, parents);
}

struct ViewPlannerTest : testing::Test {
  VesselTree tree = corner();
  ViewPlanner view{tree, {0, 0.2}, {}, {}};
};

double alongBeam(const PlannedView& answer, const Eigen::Vector3d& direction) {
  return std::abs(beamDirection(answer.angles).dot(direction));
}

TEST_F(ViewPlannerTest, LooksAcrossTheStretchAheadAndAgainWhenThatEnds) {
  const auto first = view.next({0, 0.01}, false);
  ASSERT_TRUE(first);
  // The best of all sees the stretch in its full length; nodes are 7.5 deg apart, and the last search refines them.
  EXPECT_LT(alongBeam(*first, Eigen::Vector3d::UnitY()), std::sin(degToRad(10)));
  EXPECT_LT((first->middle_model - Eigen::Vector3d(0, 0.035, 0)).norm(), 5e-3);
  EXPECT_FALSE(view.next({0, 0.03}, false));
  EXPECT_FALSE(view.next({0, 0.054}, false));
  EXPECT_TRUE(view.next({0, 0.06}, false));
  // Back to before what the present view was chosen for.
  EXPECT_TRUE(view.next({0, 0.01}, false));
  // To the end of the route one view serves.
  ASSERT_TRUE(view.next({0, 0.15}, false));
  EXPECT_FALSE(view.next({0, 0.199}, false));
}

TEST_F(ViewPlannerTest, DoubtAsksForAViewFromElsewhere) {
  const auto first = view.next({0, 0.01}, false);
  const auto second = view.next({0, 0.01}, true);
  ASSERT_TRUE(first && second);
  const double cosine = std::abs(beamDirection(first->angles).dot(beamDirection(second->angles)));
  EXPECT_GE(radToDeg(std::acos(cosine)), ViewPlannerSettings().other_deg - 1e-6);
  EXPECT_LT(alongBeam(*second, Eigen::Vector3d::UnitY()), std::sin(degToRad(10)));
}

TEST(ViewPlanner, KeepsAViewThatNoOtherInReachCouldReplace) {
  const VesselTree tree = corner();
  BestViewScene scene;
  scene.reachable = [](const ViewAngles& angles) {
    return std::hypot(angles.primary_rad, angles.secondary_rad) < degToRad(12);
  };
  ViewPlanner view(tree, {0, 0.2}, scene, {});
  ASSERT_TRUE(view.next({0, 0.01}, false));
  EXPECT_FALSE(view.next({0, 0.01}, true));
}

TEST(ViewPlanner, KnowsWhereARouteWasLeft) {
  const VesselTree made = test::branchingTree(4);
  const TreeTopology map(made);
  const int target = map.branchCount() - 1, trunk = map.pathTo(target).front();
  ViewPlannerSettings settings;
  settings.behind_mm = 5;
  settings.ahead_mm = 10;
  settings.renew_mm = 0;
  ViewPlanner view(made, {target, map.length_m(target)}, {}, settings);
  const TreeLocation fork{trunk, map.length_m(trunk)};
  const auto here = view.next(fork, false);
  ASSERT_TRUE(here);
  for (const int child : map.children(trunk)) {
    if (map.passes(target, child)) continue;
    EXPECT_FALSE(view.next({child, map.length_m(child)}, false));
  }
}

// A vessel along +S from which two branches part in a plane that is turned about it: seen along its normal a tip's side
// is seen too. The vessel alone leaves all views around it alike.
TEST(ViewPlanner, LooksAcrossTheForksOfALooseCatheter) {
  for (const double turned_deg : {20.0, 70.0}) {
    const Eigen::Vector3d side(std::cos(degToRad(turned_deg)), std::sin(degToRad(turned_deg)), 0);
    constexpr int kTrunk = 30, kBranch = 15;
    Eigen::Matrix3Xd points(3, kTrunk + 2 * kBranch);
    std::vector<int> parents;
    for (int i = 0; i < points.cols(); ++i) {
      const bool on_trunk = i < kTrunk, second = i >= kTrunk + kBranch;
      const int along = on_trunk ? i : (i - kTrunk) % kBranch + 1;
      points.col(i) = Eigen::Vector3d(0, 0, 2e-3 * (on_trunk ? along : kTrunk - 1 + 0.7 * along));
      if (!on_trunk) points.col(i) += (second ? -1 : 1) * 1.4e-3 * along * side;
      parents.push_back(i == kTrunk || i == kTrunk + kBranch ? kTrunk - 1 : i - 1);
    }
    const VesselTree tree(points, parents);
    const TreeTopology map(tree);
    ASSERT_EQ(map.branchCount(), 3);
    ViewPlanner view(tree, {1, 15e-3}, {}, {});
    const auto answer = view.next({0, 40e-3}, false, true);
    ASSERT_TRUE(answer);
    // Seen as long as it is to 3 %, which is 14 deg, and at no more cost than kShownWell leaves free.
    EXPECT_LT(alongBeam(*answer, side), std::sqrt(1 - 0.85 * 0.85) + 0.02) << turned_deg;
    EXPECT_LT(alongBeam(*answer, Eigen::Vector3d::UnitZ()), std::sin(degToRad(14))) << turned_deg;
  }
}

TEST(ViewPlanner, RefusesATargetThatIsNoPlaceOfTheTree) {
  const VesselTree tree = corner();
  EXPECT_EQ(test::refusalOf([&] {
              ViewPlanner(tree, {7, 0}, {}, {});
            }),
            "view planner: target = 7: must be one of the tree's 1 branches");
}

}  // namespace
}  // namespace angio::test
