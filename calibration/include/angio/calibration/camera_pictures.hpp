// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>

#include "angio/calibration/camera_calibration.hpp"

namespace angio::calibration {

/// One view: its image (CV_8UC1 or CV_16UC1, or empty for a dark ground) with rings where beads were seen and crosses
/// where the camera puts them; red for beads left out. CV_8UC3 of the detector's size, larger when it is small.
cv::Mat viewOverlay(const CameraCalibration& result, std::size_t view, const cv::Mat& image);

/// All views' residuals on the detector as arrows, by view in colours, CV_8UC3.
struct ResidualField {
  cv::Mat picture;
  double enlargement = 1;  ///< Of the arrows: a power of ten, or two or five of it.
};
ResidualField residualField(const CameraCalibration& result);

/// How many beads each part of the detector has seen, CV_8UC3: dark for none.
cv::Mat coverageMap(const CameraCalibration& result);

}  // namespace angio::calibration
