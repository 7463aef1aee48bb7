// SPDX-License-Identifier: GPL-2.0-or-later
#include "xray_image.hpp"

#include <opencv2/core.hpp>

#include "angio/base/errors.hpp"
#include "angio/imaging/visp.hpp"
#include "angio/imaging/xray_frame.hpp"

namespace angio::imaging {

void requireXray(const cv::Mat& image) {
  if (image.empty()) throw InputError("image", "size", "0 x 0", "must have pixels");
  if (image.type() == CV_8UC1 || image.type() == CV_16UC1) return;
  throw InputError("image", "type", cv::typeToString(image.type()), "must be CV_8UC1 or CV_16UC1");
}

XrayFrame cropped(const XrayFrame& frame, const cv::Rect& window) {
  const bool inside = window.x >= 0 && window.y >= 0 && window.width > 0 && window.height > 0 &&
                      window.width <= frame.image.cols - window.x && window.height <= frame.image.rows - window.y;
  if (!inside) {
    const auto size = [](int width, int height) { return std::to_string(width) + " x " + std::to_string(height); };
    throw InputError(
        "image", "window",
        size(window.width, window.height) + " at " + std::to_string(window.x) + ", " + std::to_string(window.y),
        "must lie within the " + size(frame.image.cols, frame.image.rows) + " of the image");
  }
  XrayCamera::Parameters camera = frame.camera.parameters();
  camera.width_px = window.width;
  camera.height_px = window.height;
  camera.cx_px -= window.x;
  camera.cy_px -= window.y;
  return {frame.time_us, frame.sequence, frame.image(window), XrayCamera(camera)};
}

cv::Mat fromVisp(const vpImage<unsigned char>& image) {
  if (image.getSize() == 0) throw InputError("image", "size", "0 x 0", "must have pixels");
  const int rows = static_cast<int>(image.getHeight()), cols = static_cast<int>(image.getWidth());
  return cv::Mat(rows, cols, CV_8UC1, const_cast<unsigned char*>(image.bitmap)).clone();
}

vpImage<unsigned char> toVisp(const cv::Mat& image) {
  requireXray(image);
  vpImage<unsigned char> result(static_cast<unsigned>(image.rows), static_cast<unsigned>(image.cols));
  cv::Mat view(image.rows, image.cols, CV_8UC1, result.bitmap);
  if (image.type() == CV_8UC1) {
    image.copyTo(view);
    return result;
  }
  double low = 0, high = 0;
  cv::minMaxLoc(image, &low, &high);
  const double factor = high > low ? 255 / (high - low) : 0;
  image.convertTo(view, CV_8U, factor, -low * factor);
  return result;
}

}  // namespace angio::imaging
