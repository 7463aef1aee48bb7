// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "angio/geometry/se3.hpp"
#include "angio/types/model_id.hpp"

namespace angio::types {

/// What a registration said of one frame. `status` is its RegistrationStatus by number, `status_text` the
/// same in words.
struct RegistrationMessage {
  std::int64_t time_us = 0;
  std::int64_t frame_sequence = 0;
  ModelId model_id = ModelId::kUnknown;  ///< Of the tree that was registered.
  std::int8_t status = 0;
  std::string status_text;
  Pose T_camera_model = Pose::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< [translation; rotation], m and rad.
  double mean_residual_px = 0;
  std::int32_t points_3d = 0;
  std::int32_t points_2d = 0;
};

}  // namespace angio::types
