// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <visp3/core/vpImage.h>

#include <opencv2/core/mat.hpp>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// A copy of ViSP's grey image as CV_8UC1, ready for CenterlineExtractor::extract. Throws InputError when it is empty.
cv::Mat fromVisp(const vpImage<unsigned char>& image);

/// A grey image as ViSP's. CV_8UC1 is copied; CV_16UC1 is scaled so that its least value becomes 0 and its greatest
/// 255, and a constant image becomes 0. Throws InputError for any other type or an empty image.
vpImage<unsigned char> toVisp(const cv::Mat& image);

}  // namespace angio::imaging
