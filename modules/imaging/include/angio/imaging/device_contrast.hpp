// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// How much darker than its surroundings each pixel of a part of an X-ray image is, at the width of a thin device.
struct DeviceContrast {
  cv::Mat contrast;     ///< CV_32FC1, of the window's size: absorption against the surroundings, positive where darker.
  cv::Point corner;     ///< Of the window in the image [px].
  double noise = 1e-3;  ///< Standard deviation of the contrast where nothing thin is.

  /// At a place of the whole image [px], bilinear; 0 outside of the window.
  float at(double x_px, double y_px) const;
};

/// Absorption against the surroundings: the image's logarithm, blurred as a device of `width_px` [px] is wide, against
/// itself blurred three times as much (a difference of Gaussians), so that what varies slowly drops out.
///
/// What reaches out of the image of the window is cut. Throws InputError when the image is neither CV_8UC1 nor
/// CV_16UC1, the width not positive, or the window and the image have nothing in common.
DeviceContrast deviceContrast(const cv::Mat& image, const cv::Rect& window, double width_px);

}  // namespace angio::imaging
