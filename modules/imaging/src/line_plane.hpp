// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "plane.hpp"

namespace angio::imaging {

/// A plane that is zero but for lines. Blocks of pixels that hold anything are marked; the others are not written or
/// read from image to image, for most of an image is no line and memory is what its passes wait for.
class LinePlane {
 public:
  static constexpr int kBlock = Plane::kSlack / 2;  ///< Pixels of a row; a vector at most.

  /// All zero if the size is another one.
  void resize(int new_width, int new_height) {
    if (new_width == plane_.width() && new_height == plane_.height()) return;
    plane_ = Plane();
    plane_.resize(new_width, new_height);
    marks_per_row_ = (new_width + kBlock - 1) / kBlock + 2;
    marks_.assign(static_cast<std::size_t>(marks_per_row_) * new_height, 0);
  }

  int width() const { return plane_.width(); }
  int height() const { return plane_.height(); }
  float* row(int y) { return plane_.row(y); }
  const float* row(int y) const { return plane_.row(y); }

  /// Whether a block of the row may hold anything but zeros: 0 or 1. Two blocks beyond its end are 0.
  std::uint8_t* marks(int y) { return marks_.data() + static_cast<std::ptrdiff_t>(y) * marks_per_row_; }
  const std::uint8_t* marks(int y) const { return marks_.data() + static_cast<std::ptrdiff_t>(y) * marks_per_row_; }

  const Plane& plane() const { return plane_; }
  const cv::Mat mat() const { return plane_.mat(); }

 private:
  Plane plane_;
  int marks_per_row_ = 0;
  std::vector<std::uint8_t> marks_;
};

}  // namespace angio::imaging
