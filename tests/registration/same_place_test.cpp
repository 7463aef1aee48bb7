// SPDX-License-Identifier: GPL-2.0-or-later
#include "same_place.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "angio/test/phantoms.hpp"
#include "angio/test/random.hpp"

namespace angio::registration {
namespace {

constexpr double kStd_m = 10e-3;
constexpr bool kSingle = true, kSeveral = false;

// A tree some 0.75 m from the source and off the axis, in the camera frame.
Eigen::Matrix3Xd someTree() {
  const VesselTree tree = test::branchingTree(3);
  return (tree.points().colwise() - tree.centroid()).colwise() + Eigen::Vector3d(0.05, -0.03, 0.75);
}

// Each place on its own beam, so many metres further along it.
Eigen::Matrix3Xd along(const Eigen::Matrix3Xd& tree, const Eigen::VectorXd& by_m) {
  return tree + tree.colwise().normalized() * by_m.asDiagonal();
}

TEST(SamePlace, ASingleViewLeavesTheDepthOfTheWholeOpen) {
  const Eigen::Matrix3Xd here = someTree();
  for (const double shift_m : {-0.06, 0.02, 0.06}) {
    const Eigen::Matrix3Xd there = along(here, Eigen::VectorXd::Constant(here.cols(), shift_m));
    EXPECT_TRUE(isSamePlace(here, there, kSingle, kStd_m)) << shift_m;
    EXPECT_EQ(isSamePlace(here, there, kSeveral, kStd_m), std::abs(shift_m) < 3 * kStd_m) << shift_m;
  }
}

TEST(SamePlace, NearAndFarExchangedIsAnotherAnswer) {
  const Eigen::Matrix3Xd here = someTree();
  const Eigen::VectorXd depth_m = here.colwise().norm();
  const Eigen::VectorXd relief_m = depth_m.array() - depth_m.mean();
  const Eigen::VectorXd shift_m = Eigen::VectorXd::Constant(here.cols(), 0.03);
  EXPECT_FALSE(isSamePlace(here, along(here, -2 * relief_m), kSingle, kStd_m));
  EXPECT_FALSE(isSamePlace(here, along(here, shift_m - 2 * relief_m), kSingle, kStd_m));
  // Half of it is a tree that is flatter, as strain makes it.
  EXPECT_TRUE(isSamePlace(here, along(here, shift_m - 0.5 * relief_m), kSingle, kStd_m));
}

TEST(SamePlace, AcrossTheBeamItIsWithinThreeMillimetres) {
  test::Random random(3);
  const Eigen::Matrix3Xd here = someTree();
  for (const bool single : {kSingle, kSeveral}) {
    for (const double across_m : {2.5e-3, 3.5e-3}) {
      Eigen::Matrix3Xd there = here;
      for (Eigen::Index i = 0; i < here.cols(); ++i) {
        there.col(i) += across_m * here.col(i).cross(random.vector(1)).normalized();
      }
      EXPECT_EQ(isSamePlace(here, there, single, kStd_m), across_m < 3e-3);
    }
  }
}

TEST(SamePlace, WhatIsNotFiniteIsNoPlace) {
  const Eigen::Matrix3Xd here = someTree();
  Eigen::Matrix3Xd there = here;
  there(2, 5) = std::numeric_limits<double>::quiet_NaN();
  for (const bool single : {kSingle, kSeveral}) EXPECT_FALSE(isSamePlace(here, there, single, kStd_m));
  EXPECT_FALSE(isSamePlace(Eigen::Matrix3Xd(3, 0), Eigen::Matrix3Xd(3, 0), kSingle, kStd_m));
}

}  // namespace
}  // namespace angio::registration
