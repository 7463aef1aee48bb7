// SPDX-License-Identifier: GPL-2.0-or-later
#include "tube_templates.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace angio {
namespace {

// How far the samples reach, and where their weight has fallen to a half: the background on both sides is needed, the
// neighbouring vessel is not.
constexpr double kReachRadii = 1.5, kReachBlurs = 2.2;
constexpr double kWeightEdge = 0.35;

// Chord of a circle, 1 in its middle, averaged over a normal distribution about x.
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

}  // namespace

void TubeTemplates::add(float radius, float blur) {
  Template t;
  t.radius = radius;
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
      t.solution[k][i] = static_cast<float>(solution(k, i));
      t.model[k][i] = static_cast<float>(J(i, k));
    }
  }
  templates_.push_back(t);
}

TubeTemplates::Fit TubeTemplates::Template::fit(const std::array<float, kSamples>& samples) const {
  std::array<float, 5> p{};
  for (int k = 0; k < 5; ++k) {
    for (int i = 0; i < kSamples; ++i) p[k] += solution[k][i] * samples[i];
  }
  Fit fit;
  fit.contrast = p[0];
  float squares = 0;
  for (int i = 0; i < kSamples; ++i) {
    float left = samples[i];
    for (int k = 0; k < 5; ++k) left -= p[k] * model[k][i];
    squares += left * left;
  }
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

}  // namespace angio
