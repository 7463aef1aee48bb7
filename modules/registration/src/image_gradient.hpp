// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "angio/registration/xray_view.hpp"

namespace angio::registration {

/// The gradient of the attenuation that an X-ray image shows, at one smoothness.
class ImageGradient {
 public:
  /// @param attenuation  CV_32FC1, larger where more is in the beam.
  ImageGradient(const cv::Mat& attenuation, double smoothing_px);

  /// At a place of the image, bilinear [1/px]; zero beyond it.
  Eigen::Vector2d at(const Eigen::Vector2d& pixel) const;

 private:
  cv::Mat du_, dv_;
};

/// What is wider than this is anatomy, not a vessel [px].
constexpr double kAnatomy_px = 40;

/// Log-attenuation of what is not wider than a vessel: the logarithm of an X-ray image turned round, less the same
/// smoothed over kAnatomy_px. CV_32FC1 from CV_8UC1 or CV_16UC1.
cv::Mat vesselAttenuation(const cv::Mat& image);

}  // namespace angio::registration
