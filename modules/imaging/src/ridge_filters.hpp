// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "plane.hpp"

namespace angio::imaging {

/// values = level - ln(values + offset), for a row of a Plane.
void toAbsorption(float* values, int count, float offset, float level);

/// What the neighbours in two filters weigh, and how far they reach, the second one no less than the first.
struct PairOfWeights {
  const float *weight, *other;
  int reach, other_reach;
};

/// A separable filter that is the same to both sides, made row by row; the edges go on outside.
class RowFilter {
 public:
  static constexpr int kMaxReach = 32;

  /// What the middle weighs, and each neighbour from there outwards.
  explicit RowFilter(std::vector<float> weights) : weight_(std::move(weights)) {}

  /// So many neighbours to each side count.
  int reach() const { return static_cast<int>(weight_.size()) - 1; }

  /// Makes a row of the filtered image. `to` is written a whole vector past its end.
  void row(const Plane& from, int y, float* to);

  /// The same, and with a filter that reaches no less far.
  void row(const Plane& from, int y, float* to, RowFilter& wider, float* to_wider);

 private:
  // A row, and its neighbours from there outwards.
  struct Rows {
    void gather(const Plane& from, int y, int reach);
    const float* row[2 * kMaxReach + 1];
  };

  void makeRoom(int width);
  void finish(int width, float* to);

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
