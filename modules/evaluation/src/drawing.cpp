// SPDX-License-Identifier: GPL-2.0-or-later
#include "drawing.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace angio::evaluation {

const cv::Scalar kGroundColor(24, 20, 18);

cv::Point subpixel(const Eigen::Vector2d& p) {
  const double scale = 1 << kSubpixelBits;
  // Far outside is far outside: keeps the fixed point numbers from overflowing.
  const auto fixed = [&](double x) { return static_cast<int>(std::lround(std::clamp(x, -3e4, 3e4) * scale)); };
  return {fixed(p.x()), fixed(p.y())};
}

// The darkest and brightest half per cent do not count: a few hot pixels must not make the image grey.
cv::Mat greyPicture(const cv::Mat& image) {
  cv::Mat color;
  cv::Mat values = image.clone().reshape(1, 1);  // Cloned first: a window into a larger image is no single row.
  cv::sort(values, values, cv::SORT_EVERY_ROW | cv::SORT_ASCENDING);
  values.convertTo(values, CV_32F);
  const int n = values.cols;
  const float low = values.at<float>(n / 200), high = std::max(low + 1, values.at<float>(n - 1 - n / 200));
  cv::Mat grey;
  image.convertTo(grey, CV_8U, 255.0 / (high - low), -255.0 * low / (high - low));
  cv::cvtColor(grey, color, cv::COLOR_GRAY2BGR);
  return color;
}

void drawCurve(cv::Mat& canvas, const Centerline2d& centerline, const cv::Scalar& color_bgr, int width_px) {
  for (int i = 0; i < centerline.size(); ++i) {
    const cv::Point here = subpixel(centerline.points_px.col(i));
    const bool joined = i > 0 && centerline.ordered() && centerline.branch[i] == centerline.branch[i - 1];
    const cv::Point there = joined ? subpixel(centerline.points_px.col(i - 1)) : here;
    cv::line(canvas, there, here, color_bgr, width_px, cv::LINE_AA, kSubpixelBits);
  }
}

void writeText(cv::Mat& canvas, const std::string& text, const cv::Point& at, const cv::Scalar& color_bgr) {
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, 0.75, cv::Scalar(0, 0, 0), 5, cv::LINE_AA);
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, 0.75, color_bgr, 2, cv::LINE_AA);
}

}  // namespace angio::evaluation
