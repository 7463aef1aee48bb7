// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>

#include "blur.hpp"

namespace angio::simulation {

/// Quanta that were scattered in the patient: a wide, smooth copy of the image that adds to it.
///
/// Source: Boone, Seibert, An analytical model of the scattered radiation distribution in diagnostic radiology, Med
/// Phys 15 (1988): the primary image convolved with a wide kernel.
class Scatter {
 public:
  /// @param ratio  Scattered over primary quanta. @param std_px  Width of the kernel, standard deviation.
  Scatter(double ratio, double std_px);

  /// Adds the scatter of a CV_32FC1 image to it.
  void add(cv::Mat& primary, int threads);

 private:
  static constexpr int kCell = 16;  // [px] Scatter knows no finer structures.
  double ratio_;
  Blur blur_;
  cv::Mat cells_, blurred_;
};

}  // namespace angio::simulation
