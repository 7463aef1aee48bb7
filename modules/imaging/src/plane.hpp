// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// A grey image in floating point whose rows can be written a whole vector past their end, and read from the pixel
/// before them. It keeps its memory when it
/// becomes smaller.
class Plane {
 public:
  static constexpr int kSlack = 32;  ///< Twice the longest vector: a row and its neighbour can be read past its end.

  void resize(int new_width, int new_height) {
    width_ = new_width;
    height_ = new_height;
    stride_ = (new_width + kSlack - 1) / kSlack * kSlack;
    const std::size_t wanted = (static_cast<std::size_t>(stride_) * new_height + 3 * kSlack) / kOfLine;
    if (lines_.size() < wanted) lines_.resize(wanted);
  }

  int width() const { return width_; }
  int height() const { return height_; }
  float* row(int y) { return first() + static_cast<std::ptrdiff_t>(y) * stride_; }
  const float* row(int y) const { return first() + static_cast<std::ptrdiff_t>(y) * stride_; }

  /// The same pixels as OpenCV sees them; nothing is copied.
  cv::Mat mat() { return {height_, width_, CV_32FC1, first(), static_cast<std::size_t>(stride_) * sizeof(float)}; }

  const cv::Mat mat() const { return const_cast<Plane*>(this)->mat(); }

  /// Between pixels, bilinear; beyond the image its edge goes on.
  float at(float x, float y) const {
    x = x < 0 ? 0 : (x > static_cast<float>(width_ - 1) ? static_cast<float>(width_ - 1) : x);
    y = y < 0 ? 0 : (y > static_cast<float>(height_ - 1) ? static_cast<float>(height_ - 1) : y);
    const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
    const int right = x0 + 1 < width_ ? 1 : 0;
    const float *upper = row(y0) + x0, *lower = row(y0 + 1 < height_ ? y0 + 1 : y0) + x0;
    const float u = x - static_cast<float>(x0), v = y - static_cast<float>(y0);
    return (1 - v) * ((1 - u) * upper[0] + u * upper[right]) + v * ((1 - u) * lower[0] + u * lower[right]);
  }

  /// The same where `x` and `y` are at least 0 and less than the last column and row.
  float within(float x, float y) const {
    const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
    const float *upper = row(y0) + x0, *lower = upper + stride_;
    const float u = x - static_cast<float>(x0), v = y - static_cast<float>(y0);
    return (1 - v) * ((1 - u) * upper[0] + u * upper[1]) + v * ((1 - u) * lower[0] + u * lower[1]);
  }

  bool contains(float x, float y) const {
    return x >= 0 && y >= 0 && x < static_cast<float>(width_ - 1) && y < static_cast<float>(height_ - 1);
  }

 private:
  // Rows begin with a cache line, so that no vector of a row lies on two.
  static constexpr int kOfLine = 16;
  struct alignas(kOfLine * sizeof(float)) CacheLine {
    float values[kOfLine];
  };
  static_assert(kSlack % kOfLine == 0);

  // A pixel before the first row can be read.
  float* first() { return lines_[1].values; }
  const float* first() const { return lines_[1].values; }

  std::vector<CacheLine> lines_ = std::vector<CacheLine>(2);
  int width_ = 0, height_ = 0, stride_ = 0;
};

}  // namespace angio::imaging
