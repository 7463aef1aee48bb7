// SPDX-License-Identifier: GPL-2.0-or-later
#include "ridge_mask.hpp"

#include <algorithm>
#include <array>
#include <cstring>

namespace angio::imaging {
namespace {

constexpr std::uint8_t kWeak = 1, kStrong = 2;

}  // namespace

cv::Mat& RidgeMask::operator()(const std::vector<RowRange>& open, const Plane& strength, const Plane& salience,
                               float weakest, float strong, int seeds) {
  const int width = strength.width(), height = strength.height(), row = width + 2;
  // A frame of one pixel spares the growing of regions its questions about the image's edge.
  classes_.create(height + 2, row, CV_8UC1);
  classes_.row(0).setTo(0);
  classes_.row(height + 1).setTo(0);
  for (int y = 0; y < height; ++y) {
    const float *value = strength.row(y), *stands_out = salience.row(y);
    std::uint8_t* to = classes_.ptr(y + 1);
    std::fill(to, to + row, std::uint8_t{0});
    for (int x = open[y].begin; x < open[y].end; ++x) {
      const int weak = value[x] > weakest ? 1 : 0;
      to[x + 1] = static_cast<std::uint8_t>(weak + (weak & (stands_out[x] > strong ? 1 : 0)));
    }
  }
  // Of the same shape, so that a pixel has the same place in both.
  framed_.create(height + 2, row, CV_8UC1);
  framed_.setTo(0);
  std::uint8_t* mask = framed_.ptr();
  const std::array<int, 8> around{1, 1 - row, -row, -1 - row, -1, row - 1, row, row + 1};
  std::uint8_t* pixel = classes_.ptr();
  const std::uint8_t* end = pixel + static_cast<std::ptrdiff_t>(row) * (height + 2);
  for (const std::uint8_t* next_seed = pixel;; ++next_seed) {
    next_seed =
        static_cast<const std::uint8_t*>(std::memchr(next_seed, kStrong, static_cast<std::size_t>(end - next_seed)));
    if (next_seed == nullptr) break;
    const int seed = static_cast<int>(next_seed - pixel);
    region_.assign(1, seed);
    pixel[seed] = 0;
    int found = 1;
    for (std::size_t next = 0; next < region_.size(); ++next) {
      for (const int step : around) {
        const int neighbour = region_[next] + step;
        if (pixel[neighbour] < kWeak) continue;
        found += pixel[neighbour] == kStrong ? 1 : 0;
        pixel[neighbour] = 0;
        region_.push_back(neighbour);
      }
    }
    if (found < seeds) continue;
    for (const int p : region_) mask[p] = 255;
  }
  mask_ = framed_(cv::Rect(1, 1, width, height));
  return mask_;
}

}  // namespace angio::imaging
