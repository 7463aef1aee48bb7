// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "plane.hpp"

namespace angio::imaging {

/// `to` = level - ln(values + offset), in place.
void toAbsorption(Plane& values, float offset, float level);

/// Gaussian filter, separable; the edges go on outside. `to` may not be `from`.
class GaussianFilter {
 public:
  /// Of this standard deviation [px]; cut off at three of them.
  explicit GaussianFilter(float sigma);

  void operator()(const Plane& from, Plane& to) const;

 private:
  std::vector<float> weight_;  ///< From the middle outwards.
  mutable std::vector<float> row_;
};

/// Every other pixel of every other row after a binomial filter of variance 1: pixel i of `to` lies on pixel 2 i.
void halve(const Plane& from, Plane& to, Plane& buffer);

/// The second derivatives' answer to "is this the middle of a dark line?", sigma^2 times the curvature across it [ln].
///
/// Zero where the image does not bend down across the line, and where the slope across it says that the line's middle
/// is further off than `reach` pixels: on the flank of a step edge the slope is as large as the bend, in the middle of
/// a line it is nothing. A blob bends along as well as across, and half of that is taken off. Borders are zero, and so
/// is what does not exceed `least` (CV_32FC1, positive, a value for each block of the image).
void ridgeStrength(const Plane& smoothed, float sigma, float reach, const cv::Mat& least, Plane& strength);

/// Makes an X-ray image smaller: each new pixel is the mean of the area that it covers, parts of pixels counting by
/// their part. The same numbers as OpenCV's INTER_AREA, to rounding, in a fifth of the time.
class AreaResampler {
 public:
  /// `image` is CV_8UC1 or CV_16UC1; `size` is not larger than it.
  void operator()(const cv::Mat& image, const cv::Size& size, Plane& to);

 private:
  // What the new pixels along one axis take: `taps` neighbours each, from `first` on, with these weights, whose sum is
  // one. The weights of all first taps stand together, then those of all second ones.
  struct Axis {
    int from = 0, to = 0, taps = 1, stride = 0;
    std::vector<int> first;
    std::vector<float> weight;
  };
  static void prepare(Axis& axis, int from, int to);

  Axis across_, down_;
  std::vector<float> row_;
};

}  // namespace angio::imaging
