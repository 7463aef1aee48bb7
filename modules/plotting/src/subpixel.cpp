// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/plotting/subpixel.hpp"

#include <algorithm>
#include <cmath>

namespace angio::plotting {

cv::Point subpixel(const cv::Point2d& p) {
  const double scale = 1 << kSubpixelBits;
  // Far outside is far outside: keeps the fixed point numbers from overflowing.
  const auto fixed = [&](double x) { return static_cast<int>(std::lround(std::clamp(x, -3e4, 3e4) * scale)); };
  return {fixed(p.x), fixed(p.y)};
}

}  // namespace angio::plotting
