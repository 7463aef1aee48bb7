// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "angio/calibration/namespace.hpp"

namespace angio::calibration {

enum class GridShape { kHexagonal, kSquare };

/// One hole of an undistortion grid.
struct GridHole {
  Eigen::Vector2i index{0, 0};          ///< Steps along the grid's two directions from the hole in the image's middle.
  Eigen::Vector2d center_px{0, 0};      ///< In the image as it is.
  Eigen::Vector2d place_pitches{0, 0};  ///< In the regular grid, in units of its pitch.
  bool whole = true;                    ///< All its neighbours are seen and the image's edge is half a pitch away.
};

/// The X-ray image of a perforated plate before the intensifier: its holes, bright, each with its place in the grid.
struct HoleGrid {
  GridShape shape = GridShape::kHexagonal;
  int width_px = 0, height_px = 0;
  double pitch_px = 0;  ///< In the image's middle, about.
  std::vector<GridHole> holes;
};

/// Finds the holes of a regular grid and which is which, without a start: the spectrum of the image's middle tells the
/// pitch, flattened and smoothed brightness peaks at the holes, and from the hole in the middle its neighbours are
/// stepped to, each by the steps at the hole before it, which follow the distortion.
///
/// The grid's directions have the image's handedness: a mirrored image of it is a regular grid too.
///
/// `image` is CV_8UC1 or CV_16UC1. Throws InputError that begins with `place` for another type, an image without a
/// regular pattern, fewer than 100 holes, and holes of which more than a fifth cannot be stepped to.
HoleGrid findHoleGrid(const std::string& place, const cv::Mat& image, GridShape shape = GridShape::kHexagonal);

}  // namespace angio::calibration
