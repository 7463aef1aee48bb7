// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// Thins the regions of a mask (CV_8UC1, zero is background) to lines one pixel wide, in place; the lines are 255.
///
/// Peels the regions from four sides in turn and takes only pixels whose loss changes neither the number of regions
/// (8-connected) nor of holes (4-connected) and that are no line's end. It visits foreground pixels only, so that its
/// time grows with the vessels' area and not with the image. Throws InputError for another type.
void thin(cv::Mat& mask);

}  // namespace angio::imaging
