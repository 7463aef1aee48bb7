// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "line_plane.hpp"

namespace angio::imaging {

/// A row of an image between its neighbours, and what a line's pixels must show there: more than `least` and than a
/// part of what finer scales show `near` by (null: no finer scale is asked). Its middle is within `reach` pixels.
struct StrengthRow {
  const float *above, *here, *below, *least, *near;
  int width;
  float sigma, reach;
};

/// The lines of a row: the column of each of their pixels, one after the other, and how the image bends at each of
/// them, in its own column: half of xx - yy and xy. There is room for a vector behind them.
struct RowLines {
  int* columns;
  float *row_difference, *row_xy;
};

/// Pixels of lines, one after the other: the column of each, its value, and how the image bends there. There is room
/// for a vector behind them.
struct LineBends {
  const int* columns;
  const float *middle, *difference, *xy;
};

/// The pixels of a plane.
struct FlankPixels {
  const float* values;
  int stride, width, height;
};

/// What pixels of lines are scored by. `finer.values` is null where no finer image is asked.
struct FlankImages {
  FlankPixels image, finer;
  float per_pixel, sigma;
};

/// An image of the scale space, and the standard deviation of its filter [its own px].
struct SmoothedImage {
  const Plane& values;
  float sigma = 1;
};

/// A finer image that has its say on a scale's lines.
struct FinerImages {
  const Plane& values;  ///< Of a scale that tells apart what the coarser one takes for one line.
  float per_pixel = 1;  ///< Its pixels per pixel of the coarser one.
  const Plane& lines;   ///< The strongest of finer lines near each pixel of the coarser image.
};

/// Finds the lines of one scale.
class ScaleLineFinder {
 public:
  /// The second derivatives' answer to "is this the middle of a dark line?", sigma^2 times the curvature across it
  /// [ln].
  ///
  /// Zero where the image does not bend down across the line, and where the slope across it says that the line's middle
  /// is further off than `reach` pixels: on the flank of a step edge the slope is as large as the bend, in the middle
  /// of a line it is nothing. A blob bends along as well as across, and half of that is taken off. Borders are zero,
  /// and so is what does not exceed `least` (CV_32FC1, positive, a value for each block of the image), what is no line
  /// by its flanks, and what is more than one line by the finer images (null: none are asked).
  void operator()(const SmoothedImage& image, float reach, const cv::Mat& least, const FinerImages* finer,
                  LinePlane& strength);

 private:
  std::vector<int> columns_, rows_;
  std::vector<float> threshold_, middle_, difference_, xy_, row_difference_, row_xy_;
};

}  // namespace angio::imaging
