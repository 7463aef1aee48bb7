// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <cstring>
#include <opencv2/core/mat.hpp>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// A framed mask (CV_8UC1) has an empty frame one pixel wide, so that every pixel within has eight neighbours and none
/// has to be asked whether it is at the image's edge.
///
/// Calls `visit(p)` with the place of each pixel within the frame that is not 0, row after row. Most of a mask is
/// empty, and is passed eight pixels at a time.
template <typename Visit>
void forEachSet(cv::Mat& framed, const Visit& visit) {
  constexpr std::ptrdiff_t kAtOnce = 8;
  for (int y = 1; y + 1 < framed.rows; ++y) {
    std::uint8_t *p = framed.ptr(y) + 1, *const end = framed.ptr(y) + framed.cols - 1;
    while (p < end) {
      std::uint64_t values = 0;
      const std::ptrdiff_t count = end - p < kAtOnce ? end - p : kAtOnce;
      std::memcpy(&values, p, static_cast<std::size_t>(count));
      for (std::ptrdiff_t k = 0; values != 0 && k < count; ++k) {
        if (p[k] != 0) visit(p + k);
      }
      p += count;
    }
  }
}

/// thin() of a framed mask, without a copy of it.
void thinFramed(cv::Mat& framed);

}  // namespace angio::imaging
