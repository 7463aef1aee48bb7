// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/device_contrast.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "angio/base/errors.hpp"
#include "quantile.hpp"
#include "xray_image.hpp"

namespace angio::imaging {
namespace {

constexpr double kSurroundings = 3;  // Times the device's width.
constexpr int kSampleStep = 7;       // Of the pixels that the noise is measured on.

// Standard deviation of most pixels: a device is few of them.
double noiseOf(const cv::Mat& contrast) {
  std::vector<float> sizes;
  for (int y = 0; y < contrast.rows; y += kSampleStep) {
    for (int x = y % 3; x < contrast.cols; x += kSampleStep) sizes.push_back(std::abs(contrast.at<float>(y, x)));
  }
  return std::max(1.4826 * medianOf(sizes), 1e-6);
}

}  // namespace

float DeviceContrast::at(double x_px, double y_px) const {
  const double x = x_px - corner.x, y = y_px - corner.y;
  if (!(x >= 0 && y >= 0 && x < contrast.cols - 1 && y < contrast.rows - 1)) return 0;
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const float u = static_cast<float>(x - x0), v = static_cast<float>(y - y0);
  const float *upper = contrast.ptr<float>(y0) + x0, *lower = contrast.ptr<float>(y0 + 1) + x0;
  return (1 - v) * ((1 - u) * upper[0] + u * upper[1]) + v * ((1 - u) * lower[0] + u * lower[1]);
}

DeviceContrast deviceContrast(const cv::Mat& image, const cv::Rect& window, double width_px) {
  requireXray(image);
  requirePositive("device contrast", "width_px", width_px);
  const cv::Rect part = window & cv::Rect(0, 0, image.cols, image.rows);
  if (part.width < 2 || part.height < 2) {
    throw InputError("device contrast", "window", std::to_string(window.x) + ", " + std::to_string(window.y),
                     "must have pixels in common with the image");
  }
  cv::Mat levels, near, around;
  image(part).convertTo(levels, CV_32F);
  levels += 1;  // Black has no logarithm.
  cv::log(levels, levels);
  const double sigma = 0.5 * width_px;
  cv::GaussianBlur(levels, near, {}, sigma, sigma, cv::BORDER_REPLICATE);
  cv::GaussianBlur(levels, around, {}, kSurroundings * sigma, kSurroundings * sigma, cv::BORDER_REPLICATE);
  DeviceContrast result;
  cv::subtract(around, near, result.contrast);
  result.corner = part.tl();
  result.noise = noiseOf(result.contrast);
  return result;
}

}  // namespace angio::imaging
