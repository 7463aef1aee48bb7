// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/imaging/extractor_settings.hpp"
#include "area_resampler.hpp"
#include "field_outline.hpp"
#include "flatten.hpp"
#include "plane.hpp"

namespace angio::imaging {

/// What an X-ray image's beam has lost, on a grid of working pixels, where its logarithm is taken row by row as rows
/// are asked for. What a collimator shadows goes on as it is at the border of the open field: there is then no edge to
/// answer to, and no noise of the dark.
class AbsorptionRows {
 public:
  /// Takes an image. `border_px` is the margin of the open field that is not looked at [px of the image].
  void begin(const cv::Mat& image, const WorkingGrid& grid, Polarity polarity, double border_px);

  /// Makes the rows before this one, as far as they are not made.
  void makeBefore(int end);

  /// The logarithm, in the rows that are made.
  const Plane& image() const { return absorption_; }

  /// What of each row is looked at.
  const std::vector<RowRange>& open() const { return open_; }

 private:
  void gather(const cv::Mat& image, const WorkingGrid& grid, Polarity polarity);
  void findShadow(const cv::Mat& image, const WorkingGrid& grid, double border_px);
  void make(int y);
  void copy(int from, int to);

  AreaResampler shrink_;
  Plane absorption_;
  float dark_ = 0;  // Added to each pixel.
  int made_ = 0;
  std::vector<RowRange> lit_, open_;  // What is out of the shadow, empty where there is none; what is looked at.
  int first_lit_ = 0, last_lit_ = 0;
};

}  // namespace angio::imaging
