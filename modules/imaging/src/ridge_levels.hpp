// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "plane.hpp"

namespace angio {

/// The largest of a pixel and its neighbours, at every other pixel of every other row. CV_32FC1. `scratch` is memory.
void halveToLargest(const cv::Mat& from, cv::Mat& to, std::vector<float>& scratch);

/// The strongest line at each pixel: its strength, the radius of a vessel that is it, and the strength in noise.
struct StrongestLines {
  Plane &strength, &radius, &salience;
};

/// The next finer level's pixels from those of a halved one: the same where they lie on each other, else between.
void doubled(const StrongestLines& coarse, const StrongestLines& fine);

/// Puts a scale's lines into `best` where they are stronger. `noise` (CV_32FC1) is a value for each block of the image.
void takeStronger(const Plane& strength, const cv::Mat& noise, float radius, const StrongestLines& best);

}  // namespace angio
