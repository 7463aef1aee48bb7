// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/wide_vessels.hpp"

#include <gmock/gmock.h>

#include "angio/test/namespace.hpp"

namespace angio::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

// 4 px a millimetre at 1 m from the source.
XrayCamera camera() {
  XrayCamera::Parameters p;
  p.width_px = p.height_px = 512;
  p.fx_px = p.fy_px = 4000;
  p.cx_px = p.cy_px = 255.5;
  return XrayCamera(p);
}

Pose oneMetreAway() {
  Pose T = Pose::Identity();
  T.translation().z() = 1;
  return T;
}

// A trunk that forks into two; radii of the three branches [m], nothing: unknown. The fork is as wide as the trunk.
VesselTree forkedTree(std::optional<double> trunk, std::optional<double> left, std::optional<double> right) {
  Eigen::Matrix3Xd points(3, 5);
  points.setZero();
  points.row(0) << 0, 0.01, 0.02, 0.03, 0.03;
  points.row(1) << 0, 0, 0, 0.01, -0.01;
  return {points, {-1, 0, 1, 2, 2}, {trunk, trunk, trunk, left, right}};
}

TEST(WideVessels, AreNamedWithTheirWidthAndTheSetting) {
  const VesselTree tree = forkedTree(12e-3, 6e-3, 2e-3);
  const auto said = tooWideVessels(tree, camera(), oneMetreAway(), RidgeSettings{});
  ASSERT_TRUE(said);
  const int left = tree.branches()[1].back() == 3 ? 1 : 2;
  EXPECT_THAT(*said,
              AllOf(HasSubstr("2 of 3 branches"), HasSubstr("ridge.max_radius_px = 20"),
                    HasSubstr("0 (48 px), " + std::to_string(left) + " (24 px)"), HasSubstr("max_radius_px: 59")));
}

// The child's first point is the trunk's, and does not count.
TEST(WideVessels, WhatIsNarrowUnknownOrBehindTheSourceIsNotNamed) {
  EXPECT_FALSE(tooWideVessels(forkedTree(4.9e-3, 2e-3, 2e-3), camera(), oneMetreAway(), RidgeSettings{}));
  EXPECT_FALSE(tooWideVessels(forkedTree({}, {}, {}), camera(), oneMetreAway(), RidgeSettings{}));
  const VesselTree wide = forkedTree(12e-3, 2e-3, 2e-3);
  EXPECT_FALSE(tooWideVessels(wide, camera(), oneMetreAway().inverse(), RidgeSettings{}));
  const auto said = tooWideVessels(wide, camera(), oneMetreAway(), RidgeSettings{});
  ASSERT_TRUE(said);
  EXPECT_THAT(*said, HasSubstr("1 of 3 branches"));
}

TEST(WideVessels, TheSettingItNamesEndsIt) {
  RidgeSettings settings;
  settings.max_radius_px = 59;
  EXPECT_FALSE(tooWideVessels(forkedTree(12e-3, 6e-3, 2e-3), camera(), oneMetreAway(), settings));
  EXPECT_FALSE(tooWideVessels(forkedTree(12e-3, 6e-3, 2e-3), camera(), oneMetreAway(), OtsuSettings{}));
}

}  // namespace
}  // namespace angio::test
