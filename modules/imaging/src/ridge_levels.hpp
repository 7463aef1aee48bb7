// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "plane.hpp"

namespace angio::imaging {

/// The largest of a pixel and its neighbours, at every other pixel of every other row. CV_32FC1. `scratch` is memory.
void halveToMax(const cv::Mat& from, cv::Mat& to, std::vector<float>& scratch);

/// The strongest line at each pixel: its strength, the radius of a vessel that is it, and the strength in noise.
struct StrongestLines {
  Plane &strength, &radius, &salience;
};

/// A scale's lines: their strength, its noise (CV_32FC1, a value for each block of the image), and the radius of a
/// vessel that answers most to it.
struct ScaleLines {
  const Plane& strength;
  const cv::Mat& noise;
  float radius = 1;
};

/// The strongest lines of a level: those of the next coarser one (null: there is none), the same where its pixels lie
/// on this one's, else between, and the level's own `scales` where they are stronger.
void takeStronger(const StrongestLines* coarser, const std::vector<ScaleLines>& scales, const StrongestLines& best);

/// The pixels of a plane.
struct FlankPixels {
  const float* values;
  int stride, width, height;
};

/// What a row of lines is scored by. `finer.values` is null where no finer image is asked.
struct FlankRow {
  FlankPixels image, finer;
  float per_pixel, sigma;
  int y;
};

/// An image of the scale space, and the standard deviation of its filter [its own px].
struct SmoothedImage {
  const Plane& values;
  float sigma = 1;
};

/// A finer image that has its say on a scale's lines.
struct FinerImages {
  const Plane& values;   ///< Of a scale that tells apart what the coarser one takes for one line.
  float per_pixel = 1;   ///< Its pixels per pixel of the coarser one.
  const cv::Mat& lines;  ///< CV_32FC1, the strongest of finer lines near each pixel of the coarser image.
};

/// Leaves in a scale's strength only what is a line by its flanks, and no more than one line. `finer` may be null.
class RidgeFlanks {
 public:
  void operator()(const SmoothedImage& image, const FinerImages* finer, Plane& strength);

 private:
  std::vector<int> columns_;
};

}  // namespace angio::imaging
