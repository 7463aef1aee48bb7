// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "ridge_filters.hpp"
#include "ridge_levels.hpp"

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

  /// Analyses an absorption image. What it gives is valid until the next call.
  void analyse(const Plane& absorption, const RidgeThresholds& thresholds);

  const Plane& strength() const {
    return levels_[0].strongest;
  }                                                          ///< sigma^2 times the curvature; 0 where there is no line.
  const Plane& radius() const { return levels_[0].widest; }  ///< Of a vessel that answers most at the scale that won.
  cv::Mat radiusMat() { return levels_[0].widest.mat(); }
  cv::Mat salienceMat() { return levels_[0].salience.mat(); }
  const Plane& salience() const { return levels_[0].salience; }  ///< Strength as a multiple of the noise at its scale.

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
    GaussianFilter filter;
    Plane smoothed, strength;
    cv::Mat noise, least;  // CV_32FC1, a value a block.
  };

  struct Level {
    Plane absorption, strongest, widest, salience;
    cv::Mat finer, near_finer, pooled;
  };

  void measureNoise(Scale& scale);
  void gatherFiner(int index);
  void keepLines(int index);
  void gather(int level);
  StrongestLines linesOf(int level) {
    return {levels_[level].strongest, levels_[level].widest, levels_[level].salience};
  }

  std::vector<Scale> scales_;
  RidgeFlanks flanks_;
  std::vector<Level> levels_;
  Plane buffer_;
  std::vector<float> sample_, scratch_;
};

}  // namespace angio::imaging
