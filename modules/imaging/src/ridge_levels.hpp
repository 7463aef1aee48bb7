// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "line_plane.hpp"

namespace angio::imaging {

/// The strongest line at each pixel: its strength, the radius of a vessel that is it, and the strength in noise.
/// Radius and salience are zero where the strength is, whose marks hold for all three.
struct StrongestLines {
  LinePlane strength, radius, salience;
};

/// A scale's lines: their strength, its noise (CV_32FC1, a value for each block of the image), and the radius of a
/// vessel that answers most to it.
struct ScaleLines {
  const LinePlane& strength;
  const cv::Mat& noise;
  float radius = 1;
};

/// A row of StrongestLines.
struct StrongestRow {
  float* values[3];  ///< Strength, radius, salience.
  std::uint8_t* marks;
};

/// Two rows of the next coarser level, one above the other or the same, and the last of their pixels.
struct CoarserRows {
  const float *upper[3], *lower[3];
  const std::uint8_t *upper_marks, *lower_marks;
  int last;
};

/// A row of a scale's lines, and one over its noise.
struct ScaleRow {
  const float *strength, *per_noise;
  const std::uint8_t* marks;
  float radius;
};

/// The strongest lines of a level: those of the next coarser one (null: there is none), the same where its pixels lie
/// on this one's, else between, and the level's own `scales` where they are stronger.
void takeStronger(const StrongestLines* coarser, const std::vector<ScaleLines>& scales, StrongestLines& best);

}  // namespace angio::imaging
