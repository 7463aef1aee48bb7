// SPDX-License-Identifier: GPL-2.0-or-later
#include "ridge_scales.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

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

// The finest level has many pixels.
constexpr NoiseSampling kSampling{32, 3}, kSparseSampling{64, 6};

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
    scales_.push_back({level, sigma, own, gaussianFilter(std::sqrt(own * own - blurred)), {}, {}, {}, {}, {}});
    if (sigma >= kScaleOfRadius * max_radius) break;
  }
  levels_.resize(static_cast<std::size_t>(level) + 1);
}

void RidgeScales::analyse(const Plane& absorption, const RowsBefore& makeRows, const RidgeThresholds& thresholds) {
  smooth(absorption, 0, makeRows);
  for (int level = 1; level < static_cast<int>(levels_.size()); ++level) {
    smooth(levels_[level].absorption, level, [](int) {});
  }
  for (std::size_t k = 0; k < scales_.size(); ++k) {
    Scale& scale = scales_[k];
    scale.sampled.finish(scale.level_std, scale.noise);
    scale.least = cv::max(thresholds.noise_factor * scale.noise, thresholds.faintest);
    gatherFiner(static_cast<int>(k));
    findLines(static_cast<int>(k));
  }
  for (int level = static_cast<int>(levels_.size()) - 1; level >= 0; --level) gather(level);
}

// All that is made of a level's rows is made while they are at hand: memory is what passes over images wait for.
void RidgeScales::smooth(const Plane& image, int level, const RowsBefore& makeRows) {
  const int height = image.height();
  Plane* const next = level + 1 < static_cast<int>(levels_.size()) ? &levels_[level + 1].absorption : nullptr;
  if (next != nullptr) next->resize((image.width() + 1) / 2, (height + 1) / 2);
  std::vector<Scale*> own;
  int reach = next != nullptr ? Halving::kReach : 0;
  for (Scale& scale : scales_) {
    if (scale.level != level) continue;
    scale.smoothed.resize(image.width(), height);
    scale.sampled.begin({image.width(), height}, level == 0 ? kSparseSampling : kSampling);
    reach = std::max(reach, scale.filter.reach());
    own.push_back(&scale);
  }
  for (int y = 0; y < height; ++y) {
    makeRows(std::min(height, y + reach + 1));
    // Scales become wider: two at a time.
    std::size_t k = 0;
    for (; k + 1 < own.size(); k += 2) {
      own[k]->filter.row(image, y, own[k]->smoothed.row(y), own[k + 1]->filter, own[k + 1]->smoothed.row(y));
    }
    if (k < own.size()) own[k]->filter.row(image, y, own[k]->smoothed.row(y));
    for (Scale* scale : own) {
      if (y >= 2) scale->sampled.addRow(scale->smoothed, y - 1);
    }
    if (next != nullptr && y % 2 == 0) halving_.row(image, y, next->row(y / 2));
  }
}

// Brings the strongest lines of much finer scales to this scale's level, as wide as its filter.
void RidgeScales::gatherFiner(int index) {
  if (index < static_cast<int>(kSharper)) return;
  const Scale& scale = scales_[index];
  const Scale& next = scales_[index - kSharper];
  const Plane* fresh = &next.strength.plane();
  for (int l = next.level; l < scale.level; ++l) {
    Plane& pooled = levels_[l + 1].pooled;
    l == next.level ? largest_.halve(next.strength, pooled) : largest_.halve(*fresh, pooled);
    fresh = &pooled;
  }
  Level& level = levels_[scale.level];
  if (index == static_cast<int>(kSharper)) {
    if (fresh == &level.pooled) {
      std::swap(level.finer, level.pooled);
    } else {
      level.finer = *fresh;
    }
  } else {
    for (int l = scales_[index - 1].level; l < scale.level; ++l) largest_.halve(levels_[l].finer, levels_[l + 1].finer);
    takeLarger(*fresh, level.finer);
  }
  largest_.spread(level.finer, static_cast<int>(std::lround(kNearFiner * scale.level_std)), level.near_finer);
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
  const bool is_last = level + 1 == static_cast<int>(levels_.size());
  takeStronger(is_last ? nullptr : &levels_[level + 1].strongest, own, levels_[level].strongest);
}

void RidgeScales::findLines(int index) {
  Scale& scale = scales_[index];
  const float reach = std::max(kMinReach, kReach * scale.level_std);
  const SmoothedImage image{scale.smoothed, scale.level_std};
  if (index < static_cast<int>(kSharper)) return finder_(image, reach, scale.least, nullptr, scale.strength);
  const Scale& finer = scales_[index - kSharper];
  const float per_pixel = static_cast<float>(1 << scale.level) / static_cast<float>(1 << finer.level);
  const FinerImages images{finer.smoothed, per_pixel, levels_[scale.level].near_finer};
  finder_(image, reach, scale.least, &images, scale.strength);
}

}  // namespace angio::imaging
