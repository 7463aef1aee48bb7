// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "line_plane.hpp"

namespace angio::imaging {

/// Brings the strength of fine scales' lines to coarser images by the largest that is near. Memory is kept between
/// calls.
class LargestNear {
 public:
  /// The largest of a pixel and its neighbours, at every other pixel of every other row.
  void halve(const Plane& from, Plane& to);
  void halve(const LinePlane& from, Plane& to);

  /// The largest within `reach` rows and columns of each pixel. `to` may not be `from`.
  void spread(const Plane& from, int reach, Plane& to);

 private:
  template <typename LargestOfRows>
  void halve(int width, int height, const LargestOfRows& largestOfRows, Plane& to);

  std::vector<const float*> rows_;
  std::vector<float> tallest_;
};

/// `to` = the larger of the two at each pixel of planes of one size.
void takeLarger(const Plane& other, Plane& to);

}  // namespace angio::imaging
