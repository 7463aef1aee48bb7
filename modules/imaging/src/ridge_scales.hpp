// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "block_noise.hpp"
#include "finer_lines.hpp"
#include "ridge_classes.hpp"
#include "ridge_filters.hpp"
#include "ridge_levels.hpp"
#include "scale_lines.hpp"

namespace angio::imaging {

/// What a pixel must show to be part of a line.
struct RidgeThresholds {
  float noise_factor = 3;
  float faintest = 0.006f;  ///< Ridge strength below which there is no line, however little noise there is.
};

/// An absorption image under a Gaussian filter.
struct ScaleImage {
  const Plane* smoothed = nullptr;
  float per_pixel = 1;  ///< Pixels of this image per working pixel.
  float sigma = 1;      ///< Of the filter [working px].
  int scale = 0;
};

/// Ridge strength over all scales: where lines are, and how wide. All in working pixels.
class RidgeScales {
 public:
  /// For vessels up to this radius.
  explicit RidgeScales(float max_radius);

  /// Makes an image's rows before this one, as far as they are not made.
  using RowsBefore = std::function<void(int end)>;

  /// Analyses an absorption image, whose rows are made as they are needed. What it gives is valid until the next call.
  void analyse(const Plane& absorption, const RowsBefore& makeRows, const RidgeThresholds& thresholds);

  /// sigma^2 times the curvature; 0 where there is no line.
  const LinePlane& strength() const { return levels_[0].strongest.strength; }
  /// Of a vessel that answers most at the scale that won.
  const Plane& radius() const { return levels_[0].strongest.radius.plane(); }
  const cv::Mat radiusMat() const { return levels_[0].strongest.radius.mat(); }
  /// Strength as a multiple of the noise at its scale.
  const cv::Mat salienceMat() const { return levels_[0].strongest.salience.mat(); }
  LinePixels pixelsOf(int y) const {
    const StrongestLines& lines = levels_[0].strongest;
    return {lines.strength.row(y), lines.salience.row(y), lines.strength.marks(y), lines.strength.width()};
  }

  /// The coarsest image whose filter is not wider than `sigma`, or the finest.
  ScaleImage imageUpTo(float sigma) const;
  float sigmaUpTo(float sigma) const { return imageUpTo(sigma).sigma; }

  /// Standard deviation of such an image's values at a working pixel, noise and clutter alike.
  float noiseAt(const ScaleImage& image, const cv::Point2f& p) const;

 private:
  struct Scale {
    int level = 0;        // Halvings of the image.
    float sigma = 1;      // [working px]
    float level_std = 1;  // [pixels of the level]
    RowFilter filter;
    Plane smoothed;
    BlockNoise sampled;
    LinePlane strength;
    cv::Mat noise, least;  // CV_32FC1, a value a block.
  };

  struct Level {
    Plane absorption, finer, near_finer, pooled;
    StrongestLines strongest;
  };

  void gatherFiner(int index);
  void findLines(int index);
  void smooth(const Plane& image, int level, const RowsBefore& makeRows);
  void gather(int level);

  std::vector<Scale> scales_;
  ScaleLineFinder finder_;
  LargestNear largest_;
  std::vector<Level> levels_;
  Halving halving_;
};

}  // namespace angio::imaging
