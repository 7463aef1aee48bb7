// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "angio/simulation/attenuation_volume.hpp"
#include "angio/simulation/fluoroscopy_settings.hpp"
#include "background.hpp"
#include "torso.hpp"

namespace angio::simulation {

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
