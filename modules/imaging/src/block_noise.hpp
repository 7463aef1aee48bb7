// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "plane.hpp"

namespace angio::imaging {

/// Where a plane's noise is sampled.
struct NoiseSampling {
  int block = 32;  ///< Blocks have this side at least [px].
  int every = 3;   ///< Every so many pixels of every so many rows are looked at.
};

/// Measures the noise of a smoothed image block by block, in its second derivatives, while its rows are made.
class BlockNoise {
 public:
  /// Begins an image of this size.
  void begin(const cv::Size& size, const NoiseSampling& sampling);

  /// Looks at a row of it. Call it for each row that has one above and one below, in order, once these are made.
  void addRow(const Plane& smoothed, int y);

  /// Standard deviation of the bend across lines in noise, times sigma^2 (the variance of the image's filter [px^2]),
  /// for each block (CV_32FC1).
  void finish(float sigma, cv::Mat& noise);

 private:
  void closeBlocks();

  cv::Size size_;
  NoiseSampling sampling_;
  std::vector<std::vector<float>> samples_;  // Of the blocks of a row of blocks.
  cv::Mat squares_;                          // CV_32FC1, of the second derivatives' deviators, for each block.
  int block_ = 0, next_ = 1;                 // The row of blocks that is sampled, and its next row of pixels.
};

}  // namespace angio::imaging
