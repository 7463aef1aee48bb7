// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/extraction_run.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "angio/geometry/se3.hpp"
#include "angio/test/errors.hpp"

namespace angio::test {
namespace {

// Vessels a branch each, of equal contrast and radius unless `second` says otherwise, a point a pixel.
Centerline2d two(const Eigen::Vector2d& first_from, const Eigen::Vector2d& second_from, double second_angle_rad,
                 const ShadowProfile& second) {
  constexpr int kLength = 81;
  Eigen::Matrix2Xd points(2, 2 * kLength);
  std::vector<int> branch;
  Eigen::VectorXd radius(2 * kLength), contrast(2 * kLength);
  for (int i = 0; i < 2 * kLength; ++i) {
    const bool first = i < kLength;
    const double angle = first ? 0 : second_angle_rad, s = first ? i : i - kLength;
    points.col(i) = (first ? first_from : second_from) + s * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    branch.push_back(first ? 0 : 1);
    radius[i] = first ? 3 : second.radius_px;
    contrast[i] = first ? 0.2 : second.contrast;
  }
  Centerline2d vessels = makeCenterline(points, branch, radius);
  vessels.contrast = contrast;
  return vessels;
}

// Sparrow: two equal normal curves have one maximum up to 2 sigma. A tube far thinner than the blur casts one.
TEST(Resolved, ThinLinesPartAtSparrowsLimit) {
  for (const double blur_px : {1.0, 2.5}) {
    const ShadowProfile thin{0.02 * blur_px, 0.1};
    EXPECT_FALSE(resolved(thin, thin, 1.97 * blur_px, blur_px));
    EXPECT_TRUE(resolved(thin, thin, 2.03 * blur_px, blur_px));
  }
}

// Without a blur a chord falls from its axis on, and rises straight up at its wall: there is a minimum between two
// equal tubes once neither holds the other's axis.
TEST(Resolved, SharpTubesPartWhereEachLeavesTheOthersAxis) {
  const ShadowProfile tube{5, 0.2};
  EXPECT_FALSE(resolved(tube, tube, 4.8, 0));
  EXPECT_TRUE(resolved(tube, tube, 5.6, 0));
}

// A faint vessel on a wide one's flank is a shoulder where an equal one would be a line.
TEST(Resolved, UnequalLinesNeedMoreRoom) {
  const ShadowProfile thin{1, 0.1}, strong{1, 1.0};
  EXPECT_TRUE(resolved(thin, thin, 4, 1.5));
  EXPECT_FALSE(resolved(thin, strong, 4, 1.5));
  EXPECT_FALSE(resolved(strong, thin, 4, 1.5));
}

TEST(HaveOwnLine, OneOfTwoThatRunAsOneLosesItAndTheStrongerKeepsIt) {
  const Centerline2d merged = two({0, 50}, {0, 52}, 0, {2, 0.05});
  const std::vector<bool> own = haveOwnLine(merged, 1.5);
  EXPECT_EQ(std::count(own.begin(), own.begin() + 81, true), 81);
  EXPECT_EQ(std::count(own.begin() + 81, own.end(), true), 0);
  const std::vector<bool> apart = haveOwnLine(two({0, 50}, {0, 60}, 0, {3, 0.2}), 1.5);
  EXPECT_EQ(std::count(apart.begin(), apart.end(), false), 0);
}

TEST(HaveOwnLine, CrossingVesselsAreBothSeen) {
  const std::vector<bool> own = haveOwnLine(two({0, 50}, {40, 10}, kPi / 2, {3, 0.2}), 1.5);
  EXPECT_EQ(std::count(own.begin(), own.end(), false), 0);
}

// Vessels that part at 10 degrees stay one line until they are about a diameter apart, and never again.
TEST(HaveOwnLine, ForksAreOneLineUntilTheyPart) {
  const double angle = degToRad(10);
  const std::vector<bool> own = haveOwnLine(two({0, 50}, {0, 50}, angle, {3, 0.12}), 1.0);
  const auto lost = std::count(own.begin() + 81, own.end(), false);
  EXPECT_GT(lost, 10);
  EXPECT_LT(lost * std::sin(angle), 6);
  EXPECT_TRUE(own.back());
}

TEST(HaveOwnLine, AsksForRadiusAndContrast) {
  Centerline2d vessels = two({0, 50}, {0, 60}, 0, {3, 0.2});
  vessels.contrast.resize(0);
  EXPECT_NE(test::refusalOf([&] { haveOwnLine(vessels, 1); }).find("contrast"), std::string::npos);
}

}  // namespace
}  // namespace angio::test
