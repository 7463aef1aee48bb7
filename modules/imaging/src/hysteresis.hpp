// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "field_outline.hpp"

namespace angio::imaging {

/// Connected regions (8 neighbours) of weak and strong pixels with at least one strong pixel.
class Hysteresis {
 public:
  /// A framed mask of this size and its frame: CV_8UC1, 255 in the regions that `keep(pixels, strong_pixels)` wants.
  /// `classify(y, part, to)` writes the classes of a `part` of a row, which is what is `open` of it, to the row's
  /// bytes: 1 at weak and 2 at strong pixels; the others are 0 already. Valid until the next call.
  template <typename Classify, typename Keep>
  cv::Mat& operator()(const cv::Size& size, const std::vector<RowRange>& open, const Classify& classify,
                      const Keep& keep) {
    const int row = size.width + 2, rows = size.height + 2;
    classes_.create(rows, row, CV_8UC1);
    classes_.setTo(0);
    for (int y = 0; y < size.height; ++y) classify(y, open[y], classes_.ptr(y + 1) + 1);
    // Of the same shape, so that a pixel has the same place in both.
    framed_.create(rows, row, CV_8UC1);
    framed_.setTo(0);
    const std::array<int, 8> around{1, 1 - row, -row, -1 - row, -1, row - 1, row, row + 1};
    std::uint8_t *const pixel = classes_.ptr(), *const end = pixel + static_cast<std::ptrdiff_t>(row) * rows;
    for (std::uint8_t* seed = pixel;; ++seed) {
      seed = static_cast<std::uint8_t*>(std::memchr(seed, 2, static_cast<std::size_t>(end - seed)));
      if (seed == nullptr) break;
      region_.assign(1, static_cast<int>(seed - pixel));
      *seed = 0;
      int strong = 1;
      for (std::size_t next = 0; next < region_.size(); ++next) {
        for (const int step : around) {
          std::uint8_t& neighbour = pixel[region_[next] + step];
          if (neighbour == 0) continue;
          strong += neighbour == 2 ? 1 : 0;
          neighbour = 0;
          region_.push_back(region_[next] + step);
        }
      }
      if (!keep(region_.size(), strong)) continue;
      for (const int p : region_) framed_.data[p] = 255;
    }
    return framed_;
  }

 private:
  cv::Mat classes_, framed_;
  std::vector<int> region_;
};

}  // namespace angio::imaging
