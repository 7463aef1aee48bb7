// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/types.hpp>

#include "angio/plotting/namespace.hpp"

namespace angio::plotting {

/// Bits of a pixel's fraction in the points that subpixel makes.
constexpr int kSubpixelBits = 4;

/// A pixel position for OpenCV's drawing functions.
cv::Point subpixel(const cv::Point2d& p);

}  // namespace angio::plotting
