// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <opencv2/core/types.hpp>

#include "angio/plotting/namespace.hpp"

namespace angio::plotting {

/// Bits of a pixel's fraction in the points that subpixel makes.
constexpr int kSubpixelBits = 4;

/// A pixel position for OpenCV's drawing functions.
inline cv::Point subpixel(const cv::Point2d& p) {
  // Far outside is far outside: keeps the fixed point numbers from overflowing.
  const auto fixed = [](double x) {
    return static_cast<int>(std::lround(std::clamp(x, -3e4, 3e4) * (1 << kSubpixelBits)));
  };
  return {fixed(p.x), fixed(p.y)};
}

}  // namespace angio::plotting
