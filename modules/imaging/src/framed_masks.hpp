// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <opencv2/core/mat.hpp>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// A framed mask (CV_8UC1) has an empty frame one pixel wide, so that every pixel within has eight neighbours and none
/// has to be asked whether it is at the image's edge.
///
/// Calls `visit(p, count)` with the place of each group of up to eight pixels within the frame of which any is not 0,
/// row after row. Most of a mask is empty, and is passed 64 pixels at a time.
template <typename Visit>
void forEachSetGroup(cv::Mat& framed, const Visit& visit) {
  constexpr std::ptrdiff_t kAtOnce = 8, kWords = 8;
  for (int y = 1; y + 1 < framed.rows; ++y) {
    std::uint8_t *p = framed.ptr(y) + 1, *const end = framed.ptr(y) + framed.cols - 1;
    while (p < end) {
      std::uint64_t words[kWords] = {};
      const std::ptrdiff_t block = std::min<std::ptrdiff_t>(end - p, sizeof(words));
      std::memcpy(words, p, static_cast<std::size_t>(block));
      std::uint64_t any = 0;
      for (const std::uint64_t word : words) any |= word;
      for (std::ptrdiff_t k = 0; any != 0 && k < kWords; ++k) {
        if (words[k] != 0) visit(p + k * kAtOnce, std::min(kAtOnce, block - k * kAtOnce));
      }
      p += block;
    }
  }
}

/// Calls `visit(p)` with the place of each pixel within the frame that is not 0, row after row.
template <typename Visit>
void forEachSet(cv::Mat& framed, const Visit& visit) {
  forEachSetGroup(framed, [&](std::uint8_t* p, std::ptrdiff_t count) {
    for (std::ptrdiff_t k = 0; k < count; ++k) {
      if (p[k] != 0) visit(p + k);
    }
  });
}

/// thin() of a framed mask, without a copy of it.
void thinFramed(cv::Mat& framed);

}  // namespace angio::imaging
