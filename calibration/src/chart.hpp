// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

namespace angio {

extern const cv::Scalar kChartInk, kChartGood, kChartHeldOut, kChartLeftOut;  ///< Text; blue, orange and red marks.

/// A picture with two axes to draw into, in their units.
class Chart {
 public:
  struct Axis {
    std::string label;
    double low = 0, high = 1;
    bool ticks = true;
  };

  Chart(const std::string& title, const Axis& x, const Axis& y, cv::Size size = {720, 540});

  /// The same with as many pixels to a unit along both axes, about the middle of them.
  static Chart ofEqualScale(const std::string& title, const Axis& x, const Axis& y, cv::Size size = {720, 540});

  void disc(const Eigen::Vector2d& at, double radius_px, const cv::Scalar& colour);
  void ring(const Eigen::Vector2d& at, double radius_px, const cv::Scalar& colour, int width_px = 2);
  void line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const cv::Scalar& colour, int width_px = 2);
  void box(const Eigen::Vector2d& low, const Eigen::Vector2d& high, const cv::Scalar& colour);

  /// Text that begins so many pixels right of and below a place.
  void text(const std::string& text, const Eigen::Vector2d& at, const cv::Scalar& colour, cv::Point shift_px = {8, 4},
            double size = 0.45);

  /// CV_8UC3.
  const cv::Mat& picture() const { return picture_; }

 private:
  cv::Point at(const Eigen::Vector2d& value) const;  // In sixteenths of a pixel.

  cv::Mat picture_;
  cv::Rect frame_;
  Axis x_, y_;
};

/// One bar, and what is written under it.
struct Bar {
  std::string name;
  double value = 0;
  cv::Scalar colour;
};

/// Bars beside each other; where there are many, only some are named.
cv::Mat barChart(const std::string& title, const std::string& unit, const std::vector<Bar>& bars,
                 cv::Size size = {720, 270});

/// Pictures of one width below each other.
cv::Mat stacked(const std::vector<cv::Mat>& pictures);

}  // namespace angio
