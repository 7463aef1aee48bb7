// SPDX-License-Identifier: GPL-2.0-or-later
#include "tube_chord.hpp"

#include <algorithm>
#include <cmath>

namespace angio::imaging {
namespace {

// A sharp chord is this much of a radius blurred: the integral below needs some width.
constexpr float kSharp = 0.02f;

}  // namespace

double blurredChord(double radius, double blur, double x) {
  // With u = r sin(t) the chord's steep ends are sampled as finely as they fall.
  constexpr int kSteps = 96;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double t = M_PI * ((i + 0.5) / kSteps - 0.5), d = (x - radius * std::sin(t)) / blur;
    sum += std::cos(t) * std::cos(t) * std::exp(-0.5 * d * d);
  }
  return sum * (M_PI / kSteps) * radius / (blur * std::sqrt(2 * M_PI));
}

TubeChord::TubeChord() {
  for (int b = 0; b < kBlurs; ++b) {
    const float level = static_cast<float>(b) / (kBlurs - 1), blur = std::max(kSharp, kMaxBlur * level * level);
    for (int i = 0; i < kPlaces; ++i) {
      const float x = reach(1, blur) * static_cast<float>(i) / (kPlaces - 1);
      value_[b][i] = static_cast<float>(blurredChord(1, blur, x));
    }
  }
}

TubeChord::Profile TubeChord::of(float radius, float blur) const {
  const float level = (kBlurs - 1) * std::min(std::sqrt(blur / (kMaxBlur * radius)), 0.9999f);
  const int b = static_cast<int>(level);
  const float u = level - static_cast<float>(b);
  Profile profile;
  profile.per_px_ = (kPlaces - 1) / reach(radius, blur);
  for (int i = 0; i < kPlaces; ++i) profile.value_[i] = (1 - u) * value_[b][i] + u * value_[b + 1][i];
  return profile;
}

}  // namespace angio::imaging
