// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "plane.hpp"

namespace angio::imaging {

/// values = level - ln(values + offset), for a row of a Plane.
void toAbsorption(float* values, int count, float offset, float level);

/// A separable filter that is the same to both sides, made row by row; the edges go on outside.
class RowFilter {
 public:
  /// What the middle weighs, and each neighbour from there outwards.
  explicit RowFilter(std::vector<float> weights) : weight_(std::move(weights)) {}

  /// So many neighbours to each side count.
  int reach() const { return static_cast<int>(weight_.size()) - 1; }

  /// Makes a row of the filtered image. `to` is written a whole vector past its end.
  void row(const Plane& from, int y, float* to);

 private:
  std::vector<float> weight_, row_;
};

/// Gaussian filter of this standard deviation [px], cut off at three of them.
RowFilter gaussianFilter(float sigma);

/// Every other pixel of every other row after a binomial filter of variance 1: pixel i of the result lies on pixel 2 i.
class Halving {
 public:
  static constexpr int kReach = 2;

  /// Makes the row that lies on row `y`, which is even.
  void row(const Plane& from, int y, float* to);

 private:
  RowFilter binomial_{{6.0f / 16, 4.0f / 16, 1.0f / 16}};
  std::vector<float> filtered_;
};

}  // namespace angio::imaging
