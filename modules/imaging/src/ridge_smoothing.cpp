// SPDX-License-Identifier: GPL-2.0-or-later
// What the fits along a line say together.
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <utility>

#include "ridge_lines.hpp"
#include "smoothing_spline.hpp"

namespace angio::imaging {
namespace {

// Over how far radii and contrasts are averaged [working px], and [radii].
constexpr float kFitFilter = 1.5f, kFitRadii = 0.5f;

// How stiff a line is: the weight of its bend [1 / working px] beside that of an offset [working px], for a radius of
// kStiffRadius and in proportion to wider ones, which bend less. Fits of usual noise are then averaged over two or
// three pixels, and poor ones give way to what is known of the line before and behind them.
constexpr float kStiffness = 30, kStiffRadius = 3;

// How far the graph's lines are from the vessels' where no tube fits [working px], and for wider ones as above.
constexpr float kGraphSigma = 3;

// The normal distribution's bell, 1 at its top, out to kReach standard deviations; in steps of which the largest is a
// hundredth.
class Bell {
 public:
  static constexpr float kReach = 2.5f;

  Bell() {
    for (std::size_t i = 0; i < value_.size(); ++i) {
      const float x = (static_cast<float>(i) + 0.5f) / kPerSigma;
      value_[i] = std::exp(-0.5f * x * x);
    }
  }
  float operator()(float x) const {
    return value_[std::min(static_cast<std::size_t>(kPerSigma * x), value_.size() - 1)];
  }

 private:
  static constexpr int kPerSigma = 64;
  std::array<float, 161> value_{};
};

}  // namespace

// Averages what fits say of the vessel along the line; every point then has all values.
void RidgeFitting::average(Fitted& line) {
  Track& track = line.track;
  const std::vector<Point>& points = line.fits;
  const auto n = static_cast<std::ptrdiff_t>(points.size());
  std::vector<Point> averaged(points.size());
  static const Bell bell;
  // Each fit is asked for its weight by many points.
  std::vector<float> weight(points.size());
  for (std::ptrdiff_t j = 0; j < n; j += kFitEvery) weight[j] = points[j].valid ? points[j].weight() : 0;
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    const float sigma = std::max(kFitFilter, kFitRadii * track.radius[i]);
    averaged[i].radius = averaged[i].sigma = track.radius[i];  // Far from every fit nothing better is known.
    for (float widening = 1; widening < 20; widening *= 2) {
      const auto reach = static_cast<std::ptrdiff_t>(Bell::kReach * sigma * widening);
      float total = 0, weights = 0, weights2 = 0, variance = 0;
      Point mean;
      const float per_point = 1 / (sigma * widening);
      const std::ptrdiff_t begin = std::max<std::ptrdiff_t>(0, i - reach), end = std::min(n - 1, i + reach);
      for (std::ptrdiff_t j = (begin + kFitEvery - 1) / kFitEvery * kFitEvery; j <= end; j += kFitEvery) {
        const Point& p = points[j];
        if (!p.valid) continue;
        const float near = bell(static_cast<float>(std::abs(j - i)) * per_point);
        mean.bias += near * p.bias;
        const float sure = near * weight[j];
        total += sure;
        variance += sure * p.sigma * p.sigma;
        weights += near;
        weights2 += near * near;
        mean.radius += near * p.radius;
        mean.contrast += near * p.contrast;
        mean.misfit += near * p.misfit;
      }
      if (!(weights > 0.1f)) continue;
      Point& to = averaged[i];
      to.valid = true;
      to.radius = (mean.radius - 1) / weights;
      to.contrast = mean.contrast / weights;
      to.misfit = mean.misfit / weights;
      to.bias = mean.bias / weights;
      // Noise is the same over some pixels along the line as well: averaging gains less than the number of fits.
      const float independent = std::max(1.0f, weights * weights / weights2 * kFitEvery / kCorrelation);
      const double sigma_found = widening * std::sqrt(variance / total / independent + kModelSigma * kModelSigma);
      to.sigma = static_cast<float>(std::sqrt(sigma_found * sigma_found + static_cast<double>(to.bias) * to.bias));
      break;
    }
  }
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    if (averaged[i].valid) track.radius[i] = averaged[i].radius;
  }
  line.points = std::move(averaged);
}

// Moves the line to where its fits say that the vessel is. They then say the same of the moved line.
void RidgeFitting::recenter(Fitted& line) {
  Track& track = line.track;
  const std::size_t n = track.line.size();
  const auto wide = [&](std::size_t i) { return std::max(1.0f, track.radius[i] / kStiffRadius); };
  SmoothingSpline spline(n);
  Polyline normals(n);
  for (std::size_t i = 0; i < n; ++i) {
    const cv::Point2f along = directionAt(track.line, i, 3);
    normals[i] = {-along.y, along.x};
    const float sigma = kGraphSigma * wide(i);
    spline.measure(i, 0, 1 / (sigma * sigma));
    if (line.fits[i].valid) spline.measure(i, line.fits[i].offset, line.fits[i].weight());
  }
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const cv::Point2f bend = track.line[i - 1] - 2 * track.line[i] + track.line[i + 1];
    spline.stiffen(i, bend.dot(normals[i]), kStiffness * wide(i));
  }
  const std::vector<double> offset = spline.solve();
  for (std::size_t i = 0; i < n; ++i) {
    const auto by = static_cast<float>(offset[i]);
    track.line[i] += by * normals[i];
    line.fits[i].offset -= by;
  }
}

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
