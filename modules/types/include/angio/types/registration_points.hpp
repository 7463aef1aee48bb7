// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "angio/types/model_id.hpp"

namespace angio::types {

/// How uncertain a registration is of each point of the tree, beside the RegistrationMessage of the same frame.
struct RegistrationPoints {
  std::int64_t time_us = 0;
  std::int64_t frame_sequence = 0;
  ModelId model_id = ModelId::kUnknown;  ///< Of the tree that was registered.
  /// Of the error of each point of the tree's file, in its order, camera axes: xx, xy, xz, yy, yz, zz [m^2].
  Eigen::Matrix<float, 6, Eigen::Dynamic> covariance;
};

}  // namespace angio::types
