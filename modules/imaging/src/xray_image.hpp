// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// Throws InputError unless the image has pixels and is CV_8UC1 or CV_16UC1.
void requireXray(const cv::Mat& image);

}  // namespace angio::imaging
