// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/imaging/extractor_settings.hpp"
#include "field_outline.hpp"

namespace angio::imaging {

/// The grid on which vessels are sought: a part of the image, shrunken where it is larger than need be.
class WorkingGrid {
 public:
  /// Leaves out a margin of `border_px`, and shrinks an image whose shorter side is longer than `working_side` to that.
  WorkingGrid(const cv::Size& image, double border_px, int working_side);

  cv::Rect roi;     ///< Part of the image that is looked at [px].
  float scale = 1;  ///< Image pixels per working pixel.
  cv::Size size;    ///< Of the working image.

  /// Image position [px] of a working position.
  cv::Point2f toImage(const cv::Point2f& p) const;

  /// And the reverse.
  cv::Point2f toWorking(const cv::Point2f& p) const;

 private:
  cv::Point2f step_;  // Of the image per working pixel.
};

/// What the collimator leaves of each row of the grid, `inset` working pixels inside of its border. All of it without
/// one.
std::vector<RowRange> openRows(const cv::Mat& image, const WorkingGrid& grid, float inset);

/// What is left of an image when its background is taken away, and the background. All CV_32FC1 of the working grid's
/// size.
struct Flattened {
  const cv::Mat& absorption;  ///< About 0 outside vessels, positive in them.
  const cv::Mat& noise;       ///< Standard deviation of the absorption outside vessels, noise and clutter alike.
  const cv::Mat& background;  ///< Logarithm of the image without vessels.
};

/// X-ray image -> absorption of the vessels alone: logarithm, background taken away, noise filtered.
class Flattening {
 public:
  explicit Flattening(const OtsuSettings& settings) : settings_(settings) {}

  /// Valid until the next call.
  Flattened operator()(const cv::Mat& image, const WorkingGrid& grid);

 private:
  void estimateBackground(const WorkingGrid& grid);
  void measureNoise();

  OtsuSettings settings_;
  cv::Mat shrunken_, absorption_, coarse_, closed_, rows_, background_;
  cv::Mat block_level_, block_noise_, level_, noise_;
  std::vector<float> sample_;
};

}  // namespace angio::imaging
