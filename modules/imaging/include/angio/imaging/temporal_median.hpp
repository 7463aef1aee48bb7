// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// Median of each pixel over the last frames of a stream: quantum noise goes, what stands still stays sharp.
class TemporalMedian {
 public:
  static constexpr int kMaxFrames = 15;

  /// Over this many frames; throws InputError unless it is odd and at most kMaxFrames.
  explicit TemporalMedian(int frames);

  /// Takes a frame (CV_8UC1 or CV_16UC1) and gives the median of the last ones, as many as there have been; of an even
  /// number the lower of the two in the middle. A frame of another size or type begins a new stream. The result is
  /// valid until the next call. Throws InputError for another type or an empty image.
  const cv::Mat& add(const cv::Mat& frame);

 private:
  void sortRow(int y);

  int frames_ = 1;
  std::vector<cv::Mat> ring_, sorted_;
  std::size_t next_ = 0;
  cv::Mat smaller_, result_;
};

}  // namespace angio::imaging
