// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>

#include "angio/calibration/grid_distortion.hpp"

namespace angio::calibration {

/// The grid's image with a line from each hole to its place in the regular grid: green holes are fitted, amber ones cut
/// by the rim or the image's edge, red ones outliers. CV_8UC3 of twice the image's size.
cv::Mat gridOverlay(const HoleGrid& grid, const GridDistortion& fit, const cv::Mat& image);

}  // namespace angio::calibration
