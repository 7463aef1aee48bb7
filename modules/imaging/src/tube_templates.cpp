// SPDX-License-Identifier: GPL-2.0-or-later
#include "tube_templates.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "tube_chord.hpp"

namespace angio::imaging {
namespace {

// How far the samples reach, and where their weight has fallen to a half: the background on both sides is needed, the
// neighbouring vessel is not.
constexpr double kReachRadii = 1.5, kReachBlurs = 2.2;
constexpr double kWeightEdge = 0.35;

}  // namespace

void TubeTemplates::add(float radius, float blur) {
  Template t;
  t.radius = radius;
  t.blur = blur;
  const double r = radius, s = blur, reach = kReachRadii * r + kReachBlurs * s, step = reach / (kSamples / 2);
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
  const float place = std::log(std::max(radius, smallest_) / smallest_) / std::log(kRatio);
  return templates_[std::min(static_cast<std::size_t>(place + 0.5f), templates_.size() - 1)];
}

}  // namespace angio::imaging
