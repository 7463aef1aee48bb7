// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/visp.hpp"

#include <opencv2/core.hpp>

#include "angio/base/errors.hpp"

namespace angio::imaging {

cv::Mat fromVisp(const vpImage<unsigned char>& image) {
  if (image.getSize() == 0) throw InputError("image", "size", "0 x 0", "must have pixels");
  const int rows = static_cast<int>(image.getHeight()), cols = static_cast<int>(image.getWidth());
  return cv::Mat(rows, cols, CV_8UC1, const_cast<unsigned char*>(image.bitmap)).clone();
}

vpImage<unsigned char> toVisp(const cv::Mat& image) {
  if (image.empty()) throw InputError("image", "size", "0 x 0", "must have pixels");
  if (image.type() != CV_8UC1 && image.type() != CV_16UC1) {
    throw InputError("image", "type", cv::typeToString(image.type()), "must be CV_8UC1 or CV_16UC1");
  }
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
