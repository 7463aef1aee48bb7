// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/simulation/attenuation_volume.hpp"
#include "angio/simulation/fluoroscopy_settings.hpp"
#include "angio/simulation/namespace.hpp"
#include "torso.hpp"

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

/// What stands around the vessels, as the beam sees it: body, soft tissue and a volume. Moves with the model.
class Anatomy {
 public:
  Anatomy(const Eigen::Vector3d& center_model, const Eigen::Matrix3d& R_lps_model, const FluoroscopySettings& settings,
          std::optional<AttenuationVolume> volume);

  /// Share of the beam that passes, over its mean, on a grid: nodes every kCell pixels from pixel (0, 0) on, row by
  /// row, nodesAcross(width) to a row, up to the detector's far edges or beyond. Kept while camera and pose stay. Valid
  /// until the next call.
  const std::vector<float>& transmission(const XrayCamera& camera, const Pose& T_camera_model, int threads);

  static constexpr int kCell = 4;  // [px]
  static int nodesAcross(int size_px) { return (size_px - 1) / kCell + 2; }

 private:
  struct View {
    XrayCamera::Parameters camera;
    Eigen::Matrix4d T_camera_model;
  };
  void addTissues(const RowBand& rows, const XrayCamera& nodes, const Pose& T_camera_body);
  void addBones(const XrayCamera& nodes, const Pose& T_camera_body, int threads);

  Pose T_model_body_;
  Body body_;
  double contrast_;
  Background soft_tissue_;
  std::optional<AttenuationVolume> volume_;
  PathLengths bone_, marrow_;
  std::vector<float> grid_;
  std::optional<View> seen_;
};

}  // namespace angio::simulation
