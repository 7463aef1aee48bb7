// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>

#include "angio/geometry/xray_camera.hpp"
#include "angio/types/namespace.hpp"

namespace angio::types {

/// One live X-ray frame with the camera that saw it: K changes with the source-detector distance, so each frame has its
/// own.
struct XrayFrame {
  std::int64_t time_us = 0;   ///< Middle of the exposure, sender's monotonic clock [us].
  std::int64_t sequence = 0;  ///< Rises by one per frame.
  cv::Mat image;              ///< CV_8UC1 or CV_16UC1, size of the camera's detector.
  XrayCamera camera;
};

}  // namespace angio::types
