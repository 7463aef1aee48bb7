// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/projection.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <set>

#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

// 100 x 100 px, one pixel a millimetre at a depth of one metre.
XrayCamera smallCamera() {
  XrayCamera::Parameters p;
  p.width_px = p.height_px = 100;
  p.fx_px = p.fy_px = 1000;
  p.cx_px = p.cy_px = 50;
  return XrayCamera(p);
}

Pose oneMetreAway() {
  Pose T = Pose::Identity();
  T.translation().z() = 1;
  return T;
}

TEST(ProjectedCenterline, ABranchThatLeavesTheDetectorAndComesBackBecomesTwo) {
  // Along x in view, out at the top (y beyond -50 mm), and back.
  Eigen::Matrix3Xd points(3, 7);
  points << -30, -20, -10, 0, 10, 20, 30,  //
      0, -40, -60, -70, -60, -40, 0,       //
      0, 0, 0, 0, 0, 0, 0;
  const VesselTree tree(points * 1e-3, {-1, 0, 1, 2, 3, 4, 5});
  const Centerline2d line = projectedCenterline(tree, smallCamera(), oneMetreAway());
  ASSERT_EQ(line.size(), 4);
  EXPECT_EQ(line.branch[0], line.branch[1]);
  EXPECT_EQ(line.branch[2], line.branch[3]);
  EXPECT_NE(line.branch[1], line.branch[2]);
  EXPECT_LT((line.points_px.col(1) - Eigen::Vector2d(30, 10)).norm(), 1e-10);
  EXPECT_LT((line.points_px.col(2) - Eigen::Vector2d(70, 10)).norm(), 1e-10);
}

TEST(ProjectedCenterline, ABifurcationStandsInEachBranchThatMeetsThere) {
  Eigen::Matrix3Xd points(3, 4);
  points << -10, 0, 10, 10,  //
      0, 0, 10, -10,         //
      0, 0, 0, 0;
  const VesselTree tree(points * 1e-3, {-1, 0, 1, 1});
  const Centerline2d line = projectedCenterline(tree, smallCamera(), oneMetreAway());
  ASSERT_EQ(line.size(), 6);
  std::set<int> branches_at_bifurcation;
  for (int i = 0; i < line.size(); ++i) {
    if ((line.points_px.col(i) - Eigen::Vector2d(50, 50)).norm() < 1e-10)
      branches_at_bifurcation.insert(line.branch[i]);
  }
  EXPECT_EQ(branches_at_bifurcation.size(), 3u);
}

TEST(ProjectedCenterline, IsEmptyBehindTheSourceAndBesideTheDetector) {
  const VesselTree tree = test::branchingTree(1);
  Pose T = Pose::Identity();
  T.translation().z() = -0.75;
  EXPECT_EQ(projectedCenterline(tree, test::clinicalCamera(), T).size(), 0);
  T.translation() << 1, 0, 0.75;
  EXPECT_EQ(projectedCenterline(tree, test::clinicalCamera(), T).size(), 0);
}

}  // namespace
}  // namespace angio::test
