// SPDX-License-Identifier: GPL-2.0-or-later
#include "ridge_scales.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "quantile.hpp"

namespace angio::imaging {

// Scales are this far apart: a vessel between two of them answers with 95 % at least of what it would at its own.
constexpr float kStep = 1.6f;

// Gaussians below one pixel are not sampled well enough for second derivatives.
constexpr float kFinest = 1.0f;

// A tube's shadow answers most at this part of its radius.
constexpr float kScaleOfRadius = 0.72f;

// A level is halved once its pixels are this fine for the scale.
constexpr float kFinestOfLevel = 1.25f;

// How far from a line's middle its pixels reach, in standard deviations of the scale. At a step edge the bend is
// greatest one standard deviation off, where the slope is as large.
// One pixel of a thin line has its centre within 0.7 of the line.
constexpr float kReach = 0.5f, kMinReach = 0.75f;

// A sharper filter is this many scales away, and its lines are near within so many of the coarser one's standard
// deviations.
constexpr std::size_t kSharper = 2;
constexpr float kNearFiner = 1.2f;

// Noise is measured in blocks of this many pixels of the level at least, at some of them, by a quantile that
// vessels do not reach unless they cover half of the block. The two deviators of the second derivatives are independent
// and normal in noise, so that their length is Rayleigh's.
constexpr int kBlock = 32, kEvery = 3, kSparseBlock = 64, kSparse = 6;  // The finest level has many pixels.
constexpr float kQuantile = 0.4f, kRayleigh = 1.0108f;
constexpr float kBendPerDeviator = 1.7320508f;  // Standard deviation of the bend across, in the deviators'.

// Standard deviation of white noise under a Gaussian filter, in that of its bend times the filter's variance.
constexpr float kValuePerBend = 1.1547005f;

RidgeScales::RidgeScales(float max_radius) {
  // Variance that the halvings have left in a level [pixels of the level, squared].
  float blurred = 0;
  int level = 0;
  for (float sigma = kFinest;; sigma *= kStep) {
    while (sigma / static_cast<float>(2 << level) >= kFinestOfLevel) {
      blurred = 0.25f * (blurred + 1);
      ++level;
    }
    const float own = sigma / static_cast<float>(1 << level);
    scales_.push_back({level, sigma, own, GaussianFilter(std::sqrt(own * own - blurred)), {}, {}, {}, {}});
    if (sigma >= kScaleOfRadius * max_radius) break;
  }
  levels_.resize(static_cast<std::size_t>(level) + 1);
}

void RidgeScales::analyse(const Plane& absorption, const RidgeThresholds& thresholds) {
  for (std::size_t l = 1; l < levels_.size(); ++l)
    halve(l == 1 ? absorption : levels_[l - 1].absorption, levels_[l].absorption, buffer_);
  for (std::size_t k = 0; k < scales_.size(); ++k) {
    Scale& scale = scales_[k];
    const Plane& level = scale.level == 0 ? absorption : levels_[scale.level].absorption;
    scale.filter(level, scale.smoothed);
    measureNoise(scale);
    scale.least = cv::max(thresholds.noise_factor * scale.noise, thresholds.faintest);
    const float reach = std::max(kMinReach, kReach * scale.level_std);
    ridgeStrength(scale.smoothed, scale.level_std, reach, scale.least, scale.strength);
    gatherFiner(static_cast<int>(k));
    keepLines(static_cast<int>(k));
  }
  for (int level = static_cast<int>(levels_.size()) - 1; level >= 0; --level) {
    Level& own = levels_[level];
    const Plane& size = level == 0 ? absorption : own.absorption;
    for (Plane* plane : {&own.strongest, &own.widest, &own.salience}) plane->resize(size.width(), size.height());
    gather(level);
  }
}

// Brings the strongest lines of much finer scales to this scale's level, as wide as its filter.
void RidgeScales::gatherFiner(int index) {
  if (index < static_cast<int>(kSharper)) return;
  const Scale& scale = scales_[index];
  const Scale& next = scales_[index - kSharper];
  for (int l = next.level; l < scale.level; ++l) {
    halveToMax(l == next.level ? next.strength.mat() : levels_[l].pooled, levels_[l + 1].pooled, scratch_);
  }
  Level& level = levels_[scale.level];
  const cv::Mat fresh = next.level < scale.level ? level.pooled : next.strength.mat();
  if (index == static_cast<int>(kSharper)) {
    fresh.copyTo(level.finer);
  } else {
    for (int l = scales_[index - 1].level; l < scale.level; ++l) {
      halveToMax(levels_[l].finer, levels_[l + 1].finer, scratch_);
    }
    cv::max(level.finer, fresh, level.finer);
  }
  const int reach = static_cast<int>(std::lround(kNearFiner * scale.level_std));
  cv::dilate(level.finer, level.near_finer, cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U));
}

ScaleImage RidgeScales::imageUpTo(float sigma) const {
  std::size_t chosen = 0;
  while (chosen + 1 < scales_.size() && scales_[chosen + 1].sigma <= sigma) ++chosen;
  const Scale& scale = scales_[chosen];
  return {&scale.smoothed, 1.0f / static_cast<float>(1 << scale.level), scale.sigma, static_cast<int>(chosen)};
}

float RidgeScales::noiseAt(const ScaleImage& image, const cv::Point2f& p) const {
  const Scale& scale = scales_[image.scale];
  const float x = image.per_pixel * p.x / static_cast<float>(scale.smoothed.width());
  const float y = image.per_pixel * p.y / static_cast<float>(scale.smoothed.height());
  const int column = std::clamp(static_cast<int>(x * static_cast<float>(scale.noise.cols)), 0, scale.noise.cols - 1);
  const int row = std::clamp(static_cast<int>(y * static_cast<float>(scale.noise.rows)), 0, scale.noise.rows - 1);
  return kValuePerBend * scale.noise.at<float>(row, column);
}

// What the next coarser level found, and the level's own scales where they are stronger.
void RidgeScales::gather(int level) {
  std::vector<ScaleLines> own;
  for (const Scale& scale : scales_) {
    if (scale.level == level) own.push_back({scale.strength, scale.noise, scale.sigma / kScaleOfRadius});
  }
  if (level + 1 < static_cast<int>(levels_.size())) {
    const StrongestLines coarser = linesOf(level + 1);
    takeStronger(&coarser, own, linesOf(level));
  } else {
    takeStronger(nullptr, own, linesOf(level));
  }
}

void RidgeScales::measureNoise(Scale& scale) {
  const Plane& image = scale.smoothed;
  const int block = scale.level == 0 ? kSparseBlock : kBlock, every = scale.level == 0 ? kSparse : kEvery;
  const int rows = std::max(1, image.height() / block), cols = std::max(1, image.width() / block);
  const float sigma2 = scale.level_std * scale.level_std;
  scale.noise.create(rows, cols, CV_32F);
  for (int by = 0; by < rows; ++by) {
    for (int bx = 0; bx < cols; ++bx) {
      sample_.clear();
      const int x0 = std::max(1, bx * image.width() / cols),
                x1 = std::min(image.width() - 1, (bx + 1) * image.width() / cols);
      const int y1 = std::min(image.height() - 1, (by + 1) * image.height() / rows);
      for (int y = std::max(1, by * image.height() / rows); y < y1; y += every) {
        const float *above = image.row(y - 1), *here = image.row(y), *below = image.row(y + 1);
        for (int x = x0; x < x1; x += every) {
          const float difference = 0.5f * (here[x - 1] + here[x + 1] - above[x] - below[x]);
          const float xy = 0.25f * (above[x - 1] + below[x + 1] - above[x + 1] - below[x - 1]);
          sample_.push_back(difference * difference + xy * xy);
        }
      }
      const float square = valueAt(static_cast<std::size_t>(kQuantile * static_cast<float>(sample_.size())), sample_);
      scale.noise.at<float>(by, bx) = kBendPerDeviator * sigma2 * std::sqrt(square) / kRayleigh;
    }
  }
  cv::medianBlur(scale.noise, scale.noise, 3);
}

void RidgeScales::keepLines(int index) {
  Scale& scale = scales_[index];
  const SmoothedImage image{scale.smoothed, scale.level_std};
  if (index < static_cast<int>(kSharper)) return flanks_(image, nullptr, scale.strength);
  const Scale& finer = scales_[index - kSharper];
  const float per_pixel = static_cast<float>(1 << scale.level) / static_cast<float>(1 << finer.level);
  const FinerImages images{finer.smoothed, per_pixel, levels_[scale.level].near_finer};
  flanks_(image, &images, scale.strength);
}

}  // namespace angio::imaging
