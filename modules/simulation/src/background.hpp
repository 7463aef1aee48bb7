// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/simulation/namespace.hpp"

namespace angio::simulation {

/// Soft tissue around a point of the model: round clouds of denser and thinner tissue that move with the model. The
/// ray's integral over a normal cloud is a normal bump.
class Background {
 public:
  /// @param strength     Standard deviation of the log-attenuation.
  /// @param structure_m  Width of the largest clouds [m].
  Background(const Eigen::Vector3d& center_model, double strength, double structure_m, std::uint64_t seed);

  /// Log-attenuation on a grid: nodes every kCell pixels from pixel (0, 0) on, row by row, nodesAcross(width) to a row,
  /// up to the detector's far edges or beyond. Valid until the next call.
  const std::vector<float>& logAttenuation(const XrayCamera& camera, const Pose& T_camera_model);

  static constexpr int kCell = 8;  // [px]
  static int nodesAcross(int size_px) { return (size_px - 1) / kCell + 2; }

 private:
  struct Cloud {
    Eigen::Vector3d center;  // Model frame [m].
    double std_m;
    double peak;  // Log-attenuation.
  };
  void addCloud(const Cloud& cloud, const XrayCamera& camera, const Pose& T_camera_model);

  std::vector<Cloud> clouds_;
  std::vector<float> grid_, across_, down_;
};

}  // namespace angio::simulation
