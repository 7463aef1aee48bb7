// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// The values along a line that bend as little as what was measured of them allows.
///
/// Minimises the sum of w_i (x_i - m_i)^2 over all points, of measurements m with weights w, and of
/// s_i (x_{i-1} - 2 x_i + x_{i+1} + b_i)^2 over all inner ones, of stiffnesses s and the bends b that are there without
/// x. What is measured well is followed; where nothing is, the way between goes straight on. Source: Reinsch, Smoothing
/// by spline functions, Numerische Mathematik 10 (1967).
class SmoothingSpline {
 public:
  explicit SmoothingSpline(std::size_t count);

  /// Adds a measurement. Every point needs one, however small its weight.
  void measure(std::size_t point, double value, double weight);

  /// Adds a bend at a point with a neighbour on both sides.
  void stiffen(std::size_t point, double bend, double stiffness);

  /// The values; whatever was added is used up.
  std::vector<double> solve();

 private:
  std::vector<double> diagonal_, next_, second_, right_;  // Of the normal equations, whose matrix has five diagonals.
};

}  // namespace angio::imaging
