// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "angio/plotting/plot.hpp"

namespace angio::plotting {

/// How much of its series' colour a label keeps: the light ones are hard to read on white.
constexpr double kNameShade = 0.72;

/// What a plot is drawn on. Places are pixels from the upper left corner.
class PlotCanvas {
 public:
  using Points = std::vector<cv::Point2d>;
  enum class Anchor { kStart, kMiddle, kEnd };

  /// How something looks: what it is in the plot, and of which colour.
  struct Look {
    std::string part;  ///< A class of the report's style: "line", "rule", "axis".
    int color = kInkColor;
  };

  virtual ~PlotCanvas() = default;
  virtual void line(const Points& points, const Look& look) = 0;
  virtual void area(const Points& corners, const Look& look) = 0;
  virtual void circle(const cv::Point2d& center, double radius_px, const Look& look) = 0;
  virtual void text(const cv::Point2d& at, Anchor anchor, const std::string& words, const Look& look) = 0;
  virtual void ground(const cv::Mat& picture, const cv::Rect2d& frame) = 0;
  virtual double widthOf(const std::string& words) const = 0;
};

class SvgCanvas final : public PlotCanvas {
 public:
  void line(const Points& points, const Look& look) override { shape("polyline", points, look); }
  void area(const Points& corners, const Look& look) override { shape("polygon", corners, look); }
  void circle(const cv::Point2d& center, double radius_px, const Look& look) override;
  void text(const cv::Point2d& at, Anchor anchor, const std::string& words, const Look& look) override;
  void ground(const cv::Mat&, const cv::Rect2d&) override {}
  double widthOf(const std::string& words) const override;

  const std::string& svg() const { return svg_; }

 private:
  void shape(const std::string& tag, const Points& points, const Look& look);

  std::string svg_;
};

/// Draws into a picture, CV_8UC3; lines end at the frame.
class PictureCanvas final : public PlotCanvas {
 public:
  PictureCanvas(cv::Mat picture, const cv::Rect2d& frame) : picture_(picture), frame_(frame) {}

  void line(const Points& points, const Look& look) override;
  void area(const Points& corners, const Look& look) override;
  void circle(const cv::Point2d& center, double radius_px, const Look& look) override;
  void text(const cv::Point2d& at, Anchor anchor, const std::string& words, const Look& look) override;
  void ground(const cv::Mat& picture, const cv::Rect2d& frame) override;
  double widthOf(const std::string& words) const override;

 private:
  cv::Mat picture_;
  cv::Rect2d frame_;
};

}  // namespace angio::plotting
