// SPDX-License-Identifier: GPL-2.0-or-later
#include "xray_image.hpp"

#include <opencv2/core.hpp>

#include "angio/base/errors.hpp"

namespace angio {

void requireXray(const cv::Mat& image) {
  if (image.empty()) throw InputError("image", "size", "0 x 0", "must have pixels");
  if (image.type() == CV_8UC1 || image.type() == CV_16UC1) return;
  throw InputError("image", "type", cv::typeToString(image.type()), "must be CV_8UC1 or CV_16UC1");
}

}  // namespace angio
