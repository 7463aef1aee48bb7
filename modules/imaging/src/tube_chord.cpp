// SPDX-License-Identifier: GPL-2.0-or-later
#include "tube_chord.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace angio::imaging {

// A sharp chord is this much of a radius blurred: the integral below needs some width.
constexpr float kSharp = 0.02f;

// Of the half widths' table: all lengths in standard deviations of the blur, which makes one table do for every filter.
constexpr double kChordStep = 0.25;
constexpr int kEntries = 97;  // To 24: beyond, half a chord is sqrt(3)/2 of the radius up to a constant.

// How far a template's samples reach, and where their weight has fallen to a half: the background on both sides is
// needed, the neighbouring vessel is not.
constexpr double kTemplateRadii = 1.5, kTemplateBlurs = 2.2;
constexpr double kWeightEdge = 0.35;

double blurredChord(double radius, double blur, double x) {
  // With u = r sin(t) the chord's steep ends are sampled as finely as they fall.
  constexpr int kChordSteps = 96;
  double sum = 0;
  for (int i = 0; i < kChordSteps; ++i) {
    const double t = M_PI * ((i + 0.5) / kChordSteps - 0.5), d = (x - radius * std::sin(t)) / blur;
    sum += std::cos(t) * std::cos(t) * std::exp(-0.5 * d * d);
  }
  return sum * (M_PI / kChordSteps) * radius / (blur * std::sqrt(2 * M_PI));
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

namespace {

std::array<float, kEntries> halfWidths() {
  std::array<float, kEntries> table{};
  for (int i = 0; i < kEntries; ++i) {
    const double radius = std::max(kChordStep * i, 1e-3), level = 0.5 * blurredChord(radius, 1, 0);
    double low = 0, high = radius + 3;
    for (int k = 0; k < 30; ++k) {
      const double middle = 0.5 * (low + high);
      (blurredChord(radius, 1, middle) > level ? low : high) = middle;
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
    return sigma * (static_cast<float>(kChordStep * (kEntries - 1)) + (wanted - kTable.back()) / 0.8660254f);
  }
  const auto above = std::upper_bound(kTable.begin(), kTable.end(), wanted);
  const float step = *above - *(above - 1);
  const float place = static_cast<float>(above - kTable.begin() - 1) + (wanted - *(above - 1)) / step;
  return sigma * static_cast<float>(kChordStep) * place;
}

void TubeTemplates::add(float radius, float blur) {
  Template t;
  t.radius = radius;
  t.blur = blur;
  const double r = radius, s = blur, reach = kTemplateRadii * r + kTemplateBlurs * s, step = reach / (kSamples / 2);
  t.step = static_cast<float>(step);
  Eigen::Matrix<double, kSamples, 5> J;
  Eigen::Matrix<double, kSamples, 1> w;
  const double h = 0.02 * r;
  for (int i = 0; i < kSamples; ++i) {
    const double x = (i - kSamples / 2) * step;
    J(i, 0) = blurredChord(r, s, x);
    J(i, 1) = (blurredChord(r, s, x - h) - blurredChord(r, s, x + h)) / (2 * h);
    // The contrast of a tube grows with its radius; as parameters they are apart.
    J(i, 2) = (blurredChord(r + h, s, x) - blurredChord(r - h, s, x)) / (2 * h);
    J(i, 3) = 1;
    J(i, 4) = x;
    const double beyond = std::max(0.0, std::abs(x) - r) / (reach - r);
    w[i] = 1 - (1 - kWeightEdge) * beyond * beyond;
  }
  // A thin tube's width and contrast look alike under the blur: a prior holds the radius to what the scales said.
  Eigen::Matrix<double, 5, 5> normal = J.transpose() * w.asDiagonal() * J;
  normal(2, 2) += 0.05 * normal(0, 0) / (r * r);
  const Eigen::Matrix<double, 5, kSamples> solution = normal.ldlt().solve(J.transpose() * w.asDiagonal());
  const Eigen::Matrix<double, 5, 5> covariance = solution * solution.transpose();
  t.contrast_noise = static_cast<float>(std::sqrt(covariance(0, 0)));
  t.shift_noise = static_cast<float>(std::sqrt(covariance(1, 1)));
  for (int k = 0; k < 5; ++k) {
    for (int i = 0; i < kSamples; ++i) {
      t.solution[i][k] = static_cast<float>(solution(k, i));
      t.model[k][i] = static_cast<float>(J(i, k));
    }
  }
  templates_.push_back(t);
}

TubeTemplates::Fit TubeTemplates::Template::fit(const std::array<float, kSamples>& samples) const {
  // Sums run side by side, not one after the other: all parameters at once, then all samples.
  std::array<float, kPadded> p{};
  for (int i = 0; i < kSamples; ++i) {
    for (int k = 0; k < kPadded; ++k) p[k] += solution[i][k] * samples[i];
  }
  std::array<float, kSamples> left = samples;
  for (int k = 0; k < 5; ++k) {
    for (int i = 0; i < kSamples; ++i) left[i] -= p[k] * model[k][i];
  }
  float squares = 0;
  for (const float rest : left) squares += rest * rest;
  Fit fit;
  fit.contrast = p[0];
  fit.misfit = std::sqrt(squares / (kSamples - 5));
  if (!(p[0] > 0)) return fit;
  fit.shift = p[1] / p[0];
  fit.growth = p[2] / p[0];
  return fit;
}

const TubeTemplates::Template& TubeTemplates::nearest(float radius) const {
  const float place = std::log(std::max(radius, min_radius_) / min_radius_) / std::log(kRatio);
  return templates_[std::min(static_cast<std::size_t>(place + 0.5f), templates_.size() - 1)];
}

}  // namespace angio::imaging
