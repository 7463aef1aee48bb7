// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/simulation/namespace.hpp"

namespace angio::simulation {

/// A Gaussian filter of an image's both directions, cut where it is next to nothing; at the borders the outermost
/// pixels go on. Keeps its buffers.
class Blur {
 public:
  explicit Blur(double std_px);

  /// Whether it leaves images as they are: its neighbours have a weight below a thousandth.
  bool idle() const { return half_.size() == 1; }

  /// CV_32FC1 in and out, two images.
  void apply(const cv::Mat& in, cv::Mat& out, int threads);

 private:
  std::vector<float> half_;  // Weights at 0, 1, 2...
  std::vector<std::vector<float>> rows_;
};

}  // namespace angio::simulation
