// SPDX-License-Identifier: GPL-2.0-or-later
#include "image_gradient.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/base/errors.hpp"
#include "image_needed.hpp"

namespace angio::registration {
void requireImages(const XrayViews& views, const char* method) {
  for (const XrayView& view : views) {
    if (!view.image)
      throw InputError("", "method", method, "needs the X-ray image of each view, not its centreline alone");
    const bool fits = view.image->cols == view.camera.width_px() && view.image->rows == view.camera.height_px();
    const int type = view.image->type();
    if (!fits || (type != CV_8UC1 && type != CV_16UC1)) {
      throw InputError("", "method", method, "needs images of one channel, 8 or 16 bits, and of their camera's size");
    }
  }
}

cv::Mat vesselAttenuation(const cv::Mat& image) {
  cv::Mat logs, wide;
  image.convertTo(logs, CV_32F, 1, 1);
  cv::log(logs, logs);
  cv::GaussianBlur(logs, wide, {}, kAnatomy_px);
  return wide - logs;
}

ImageGradient::ImageGradient(const cv::Mat& attenuation, double smoothing_px) {
  cv::Mat smooth;
  cv::GaussianBlur(attenuation, smooth, {}, smoothing_px);
  // Central differences.
  const cv::Mat across = (cv::Mat_<float>(1, 3) << -0.5F, 0, 0.5F);
  cv::filter2D(smooth, du_, CV_32F, across);
  cv::filter2D(smooth, dv_, CV_32F, across.t());
}

Eigen::Vector2d ImageGradient::at(const Eigen::Vector2d& pixel) const {
  const double u = std::floor(pixel.x()), v = std::floor(pixel.y());
  if (!(u >= 0 && v >= 0 && u + 1 < du_.cols && v + 1 < du_.rows)) return Eigen::Vector2d::Zero();
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  const double a = pixel.x() - u, b = pixel.y() - v;
  const auto read = [&](const cv::Mat& image) {
    const float *above = image.ptr<float>(y) + x, *below = image.ptr<float>(y + 1) + x;
    return (1 - b) * ((1 - a) * above[0] + a * above[1]) + b * ((1 - a) * below[0] + a * below[1]);
  };
  return {read(du_), read(dv_)};
}

}  // namespace angio::registration
