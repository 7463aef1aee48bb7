// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>

#include "angio/geometry/se3.hpp"
#include "angio/perception/namespace.hpp"

namespace angio::perception {

/// Where the camera was when a frame was exposed, as far as its machine knows.
struct CameraPlace {
  std::int64_t time_us = 0;  ///< Of the exposure [us].
  Pose T_camera_patient = Pose::Identity();
};

}  // namespace angio::perception
