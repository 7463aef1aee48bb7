// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/calibration/camera_calibration.hpp"
#include "angio/test/namespace.hpp"
#include "bead_scenes.hpp"

namespace angio::test {

/// Views of a phantom with known truth.
struct CameraScene {
  std::vector<BeadView> views;
  std::vector<Pose> T_camera_phantom;
};

/// Beads as the camera sees them, with normal errors; those off the detector are missing. Any orientation, the centre
/// 780 mm from the source.
inline CameraScene cameraScene(const BeadPhantom& phantom, const CameraFile& camera, int views, double noise_px,
                               Random& random) {
  CameraScene scene;
  for (int v = 0; v < views; ++v) {
    const Eigen::Matrix3d R = anyRotation(random);
    const double x = random.uniform(-0.01, 0.01), y = random.uniform(-0.01, 0.01);
    const Pose T = phantomView(phantom, R, {x, y, 0.78});
    BeadView view{std::to_string(v + 1), {}, camera.camera.parameters().source_detector_distance_m, false};
    for (int i = 0; i < static_cast<int>(phantom.beads.size()); ++i) {
      Eigen::Vector2d px = *camera.camera.project(T * phantom.beads[static_cast<std::size_t>(i)].position_m);
      if (camera.distortion) px = camera.distortion->distorted(px);
      const double dy = random.normal(), dx = random.normal();
      px += noise_px * Eigen::Vector2d(dx, dy);
      if (camera.camera.sees(px)) view.beads.push_back({i, px, 1});
    }
    scene.views.push_back(std::move(view));
    scene.T_camera_phantom.push_back(T);
  }
  return scene;
}

inline XrayCamera trueCamera(double distance_m = 1.1) {
  XrayCamera::Parameters p = XrayCamera::centered(1024, 1024, 0.25e-3, distance_m).parameters();
  p.cx_px += 9;
  p.cy_px -= 14;
  return XrayCamera(p);
}

inline const DetectorOfViews kDetector{1024, 1024, 0.25e-3};

}  // namespace angio::test
