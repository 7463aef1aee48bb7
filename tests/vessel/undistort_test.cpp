// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/undistort.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/geometry/se3.hpp"

namespace angio::test {
namespace {

TEST(Undistorted, StraightensAPincushionedVesselWithItsWidth) {
  const XrayCamera camera = XrayCamera::centered(1024, 1024, 0.3e-3, 1.1);
  const auto tube = DetectorDistortion::intensifier(camera, {0.06, 0, degToRad(3), 0});
  // A straight vessel 6 px wide as the pinhole would show it, seen by its middle and its edge.
  const Eigen::Vector2d along = Eigen::Vector2d(2, 1).normalized(), across(-along.y(), along.x());
  const int count = 200;
  Eigen::Matrix2Xd points(2, count);
  Eigen::VectorXd radius(count);
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d pinhole_px = Eigen::Vector2d(100, 200) + 4.0 * i * along;
    Eigen::Matrix2d J;
    points.col(i) = tube.distorted(pinhole_px, &J);
    radius[i] = 3 * J.determinant() / (J * along).norm();
  }
  const Centerline2d line = undistorted(makeCenterline(points, std::vector<int>(count, 0), radius), tube);
  ASSERT_EQ(line.size(), count);
  for (int i = 0; i < count; ++i) {
    EXPECT_NEAR(across.dot(line.points_px.col(i) - Eigen::Vector2d(100, 200)), 0, 1e-9);
    // Chords of some 20 px of a bent line stand for its tangent, one-sided ones at its ends.
    EXPECT_NEAR(line.tangent_rad[i], std::atan2(along.y(), along.x()), 5e-3);
    EXPECT_NEAR(line.radius_px[i], 3, 3e-3);  // As much as the tangents are off.
  }
}

}  // namespace
}  // namespace angio::test
