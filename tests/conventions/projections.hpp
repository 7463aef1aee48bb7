// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <gtest/gtest.h>

#include "angio/conventions/xray_projection.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"

namespace angio::test {

/// Any orientation, a model some 800 mm from the source, pixels that are not square, and a principal point that is not
/// the middle: nothing that a mistake could hide behind.
inline XrayProjection randomProjection(Random& random) {
  XrayCamera::Parameters p;
  p.width_px = 640;
  p.height_px = 480;
  p.source_detector_distance_m = random.uniform(0.9, 1.2);
  p.fx_px = *p.source_detector_distance_m / 0.3e-3;
  p.fy_px = *p.source_detector_distance_m / 0.31e-3;
  p.cx_px = random.uniform(250, 400);
  p.cy_px = random.uniform(150, 300);
  Pose T = Pose::Identity();
  const double angle_rad = random.uniform(0, 3);
  T.linear() = expSO3(angle_rad * random.direction());
  T.translation() = Eigen::Vector3d(0, 0, 0.8) + random.vector(0.05);
  return {T, XrayCamera(p)};
}

/// Within 1e-9 of each number in the units of files: 1, mm, px.
inline void expectSame(const XrayProjection& a, const XrayProjection& b) {
  EXPECT_LT((a.T_camera_model.linear() - b.T_camera_model.linear()).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT(1e3 * (a.T_camera_model.translation() - b.T_camera_model.translation()).cwiseAbs().maxCoeff(), 1e-9);
  const auto &p = a.camera.parameters(), &q = b.camera.parameters();
  EXPECT_EQ(p.width_px, q.width_px);
  EXPECT_EQ(p.height_px, q.height_px);
  EXPECT_NEAR(p.fx_px, q.fx_px, 1e-9);
  EXPECT_NEAR(p.fy_px, q.fy_px, 1e-9);
  EXPECT_NEAR(p.cx_px, q.cx_px, 1e-9);
  EXPECT_NEAR(p.cy_px, q.cy_px, 1e-9);
  ASSERT_EQ(p.source_detector_distance_m.has_value(), q.source_detector_distance_m.has_value());
  if (p.source_detector_distance_m) {
    EXPECT_NEAR(1e3 * *p.source_detector_distance_m, 1e3 * *q.source_detector_distance_m, 1e-9);
  }
}

/// Where our projection has a point of the model [mm], in another program's picture.
inline Eigen::Vector2d pixelIn(const ConvertedProjection& converted, const Eigen::Vector3d& p_model_mm) {
  const auto& [T_camera_model, camera] = converted.projection;
  Eigen::Vector2d pixel = camera.project(T_camera_model * (1e-3 * p_model_mm)).value();
  if (converted.flip == PictureFlip::kLeftRight) pixel.x() = camera.width_px() - 1 - pixel.x();
  if (converted.flip == PictureFlip::kUpDown) pixel.y() = camera.height_px() - 1 - pixel.y();
  return pixel;
}

}  // namespace angio::test
