// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "plane.hpp"

namespace angio::imaging {

/// The largest of a pixel and its neighbours, at every other pixel of every other row. CV_32FC1. `scratch` is memory.
void halveToLargest(const cv::Mat& from, cv::Mat& to, std::vector<float>& scratch);

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

}  // namespace angio::imaging
