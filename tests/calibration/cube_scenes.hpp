// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/calibration/uncoded_phantom.hpp"
#include "bead_scenes.hpp"

namespace angio::test {

/// 64 equal beads on a cubic grid; x runs fastest.
inline BeadPhantom cubePhantom(double pitch_m = 0.065) {
  BeadPhantom phantom;
  phantom.name = "cube";
  for (int i = 0; i < 64; ++i) {
    phantom.beads.push_back({pitch_m * Eigen::Vector3d(i % 4, i / 4 % 4, i / 16), 0});
  }
  return phantom;
}

inline XrayCamera cubeCamera() { return XrayCamera({1024, 1024, 4450, 4450, 480, 560, {}, {}}); }

/// The cube, 0.8 m from the source, so near that a third of it is beside the detector.
inline Pose cubeView() {
  Pose T = Pose::Identity();
  T.linear() = expSO3({0, degToRad(28), 0}) * expSO3({degToRad(7), 0, degToRad(3)});
  T.translation() = Eigen::Vector3d(0.02, 0.015, 0.83) - T.linear() * cubePhantom().center_m();
  return T;
}

/// What a camera sees of equal beads: detections and, beside them, which bead each is; none for false ones.
struct UncodedScene {
  UncodedView view;
  std::vector<std::optional<int>> truth;

  /// Of some seen beads, their places and their numbers.
  ReadingHint named(const std::vector<std::size_t>& which) const {
    ReadingHint hint;
    for (const std::size_t d : which) {
      hint.named.emplace_back(view.pinhole_px.col(static_cast<Eigen::Index>(d)), truth[d].value());
    }
    return hint;
  }
};

inline UncodedScene uncodedScene(const BeadPhantom& phantom, const XrayCamera& camera, const Pose& T, double noise_px,
                                 int false_ones, Random& random) {
  UncodedScene scene;
  const auto is_open = [](const Eigen::Vector2d& px) { return px.minCoeff() > 10 && px.maxCoeff() < 1013; };
  std::vector<Eigen::Vector2d> places;
  for (int i = 0; i < static_cast<int>(phantom.beads.size()); ++i) {
    const Eigen::Vector2d px = *camera.project(T * phantom.beads[static_cast<std::size_t>(i)].position_m);
    if (!is_open(px)) continue;
    const double y = random.normal(), x = random.normal();
    places.push_back(px + noise_px * Eigen::Vector2d(x, y));
    scene.truth.emplace_back(i);
  }
  for (int k = 0; k < false_ones; ++k) {
    const double y = random.uniform(20, 1000), x = random.uniform(20, 1000);
    places.emplace_back(x, y);
    scene.truth.emplace_back();
  }
  scene.view.width_px = 1024;
  scene.view.is_open = is_open;
  scene.view.pinhole_px.resize(2, static_cast<Eigen::Index>(places.size()));
  for (std::size_t i = 0; i < places.size(); ++i) scene.view.pinhole_px.col(static_cast<Eigen::Index>(i)) = places[i];
  return scene;
}

}  // namespace angio::test
