// SPDX-License-Identifier: GPL-2.0-or-later
#include "tube_profile.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace angio::imaging {
namespace {

// All lengths in standard deviations of the blur, which makes one table do for every filter.
constexpr double kStep = 0.25;
constexpr int kEntries = 97;  // To 24: beyond, half a chord is sqrt(3)/2 of the radius up to a constant.

// The chord of a circle averaged over a normal distribution about x.
double blurredChord(double radius, double x) {
  // With u = r sin(t) the chord's steep ends are sampled as finely as they fall.
  constexpr int kSamples = 200;
  double sum = 0;
  for (int i = 0; i < kSamples; ++i) {
    const double t = M_PI * ((i + 0.5) / kSamples - 0.5), d = x - radius * std::sin(t);
    sum += std::cos(t) * std::cos(t) * std::exp(-0.5 * d * d);
  }
  return radius * sum;
}

std::array<float, kEntries> halfWidths() {
  std::array<float, kEntries> table{};
  for (int i = 0; i < kEntries; ++i) {
    const double radius = std::max(kStep * i, 1e-3), level = 0.5 * blurredChord(radius, 0);
    double low = 0, high = radius + 3;
    for (int k = 0; k < 30; ++k) {
      const double middle = 0.5 * (low + high);
      (blurredChord(radius, middle) > level ? low : high) = middle;
    }
    table[i] = static_cast<float>(0.5 * (low + high));
  }
  return table;
}

}  // namespace

float tubeRadius(float half_width, float blur) {
  static const std::array<float, kEntries> kTable = halfWidths();
  // A pixel averages over its own square, and so does the interpolation between two of them: 1/12 of variance each.
  const float sigma = std::sqrt(blur * blur + 1.0f / 6), wanted = half_width / sigma;
  if (wanted <= kTable.front()) return 0;
  if (wanted >= kTable.back()) {
    return sigma * (static_cast<float>(kStep * (kEntries - 1)) + (wanted - kTable.back()) / 0.8660254f);
  }
  const auto above = std::upper_bound(kTable.begin(), kTable.end(), wanted);
  const float step = *above - *(above - 1);
  const float place = static_cast<float>(above - kTable.begin() - 1) + (wanted - *(above - 1)) / step;
  return sigma * static_cast<float>(kStep) * place;
}

}  // namespace angio::imaging
