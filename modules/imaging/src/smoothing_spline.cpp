// SPDX-License-Identifier: GPL-2.0-or-later
#include "smoothing_spline.hpp"

#include <utility>

namespace angio::imaging {

SmoothingSpline::SmoothingSpline(std::size_t count) : diagonal_(count), next_(count), second_(count), right_(count) {}

void SmoothingSpline::measure(std::size_t point, double value, double weight) {
  diagonal_[point] += weight;
  right_[point] += weight * value;
}

void SmoothingSpline::stiffen(std::size_t point, double bend, double stiffness) {
  const std::size_t before = point - 1, after = point + 1;
  diagonal_[before] += stiffness;
  diagonal_[point] += 4 * stiffness;
  diagonal_[after] += stiffness;
  next_[before] -= 2 * stiffness;
  next_[point] -= 2 * stiffness;
  second_[before] += stiffness;
  right_[before] -= stiffness * bend;
  right_[point] += 2 * stiffness * bend;
  right_[after] -= stiffness * bend;
}

// L D L^T in place, then forwards and backwards.
std::vector<double> SmoothingSpline::solve() {
  const std::size_t n = diagonal_.size();
  for (std::size_t i = 0; i + 1 < n; ++i) {
    const double one = next_[i] / diagonal_[i];
    diagonal_[i + 1] -= one * next_[i];
    right_[i + 1] -= one * right_[i];
    if (i + 2 < n) {
      const double two = second_[i] / diagonal_[i];
      next_[i + 1] -= one * second_[i];
      diagonal_[i + 2] -= two * second_[i];
      right_[i + 2] -= two * right_[i];
      second_[i] = two;
    }
    next_[i] = one;
  }
  for (std::size_t i = n; i-- > 0;) {
    right_[i] /= diagonal_[i];
    if (i + 1 < n) right_[i] -= next_[i] * right_[i + 1];
    if (i + 2 < n) right_[i] -= second_[i] * right_[i + 2];
  }
  return std::move(right_);
}

}  // namespace angio::imaging
