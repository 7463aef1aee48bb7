// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "plane.hpp"

namespace angio::imaging {

/// An image of the scale space, and the standard deviation of its filter [its own px].
struct SmoothedImage {
  const Plane& values;
  float sigma = 1;
};

/// A finer image that has its say on a scale's lines.
struct FinerImages {
  const Plane& values;   ///< Of a scale that tells apart what the coarser one takes for one line.
  float per_pixel = 1;   ///< Its pixels per pixel of the coarser one.
  const cv::Mat& lines;  ///< CV_32FC1, the strongest of finer lines near each pixel of the coarser image.
};

/// Leaves in a scale's strength only what is a line by its flanks, and no more than one line. `finer` may be null.
class RidgeFlanks {
 public:
  void operator()(const SmoothedImage& image, const FinerImages* finer, Plane& strength);

 private:
  std::vector<int> columns_;
};

}  // namespace angio::imaging
