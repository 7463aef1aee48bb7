// SPDX-License-Identifier: GPL-2.0-or-later
#include "ridge_lines.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

namespace angio {
namespace {

constexpr float kStairFilter = 2.5f;   // Takes the staircase of the pixel grid out of a line [working px].
constexpr float kOffsetFilter = 1.5f;  // Over how far fits are averaged [working px], or over 0.5 radii.
constexpr int kSteps = 2;              // Of Gauss and Newton at each point.
constexpr float kThinnest = 0.5f;      // Radius [working px].
constexpr int kFitEvery = 2;           // Fits are made at every other point: nearer ones share their noise.

// What no noise explains: vessels bend, taper and are not round [working px].
constexpr float kModelSigma = 0.025f;

// What else than noise a fit leaves, in its contrast, moves the middle by so many radii: another vessel or a bone's
// edge on its flank. Squared misfits of up to this many times the noise's are chance.
constexpr float kBias = 2, kChance = 2;

// Where vessels meet, a line's way is a guess, and is wrong by this part of the junction's radius.
constexpr float kGuess = 0.3f;

// Noise of an image under a Gaussian filter is the same over 2 sqrt(pi) of its standard deviations.
constexpr float kCorrelation = 3.5449f;

// A tube leaves less than this part of its contrast where it is alone.
constexpr float kWorstMisfit = 0.2f;

// A vessel ends where it is fainter than this part of what it is over the fits next to its end. What is taken off is
// not longer than this many radii.
constexpr float kTailContrast = 0.6f, kTailRadii = 3;
constexpr std::size_t kFewFits = 6;
constexpr std::size_t kTipFits = 16;

// Templates are thinner than this many radii of the image's own blur.
constexpr float kBlurPart = 0.35f;

}  // namespace

RidgeFitting::RidgeFitting(float largest_radius, const RidgeScales& scales)
    : templates_(kThinnest, 1.6f * largest_radius,
                 [&](float radius) {
                   const float sigma = scales.sigmaUpTo(kBlurPart * radius);
                   // A pixel averages over its own square, and so does the interpolation between two of them.
                   return std::sqrt(sigma * sigma + 1.0f / 6);
                 }),
      largest_(1.6f * largest_radius) {}

RidgeFitting::Point RidgeFitting::fitAt(const RidgeScales& scales, const cv::Point2f& p, const cv::Point2f& along,
                                        float radius) const {
  const cv::Point2f normal(-along.y, along.x);
  Point point;
  point.radius = std::clamp(radius, kThinnest, largest_);
  std::array<float, TubeTemplates::kSamples> samples;
  for (int step = 0; step < kSteps; ++step) {
    const TubeTemplates::Template& tube = templates_.nearest(point.radius);
    const ScaleImage image = scales.imageUpTo(kBlurPart * tube.radius);
    for (int i = 0; i < TubeTemplates::kSamples; ++i) {
      const float at = point.offset + tube.step * static_cast<float>(i - TubeTemplates::kSamples / 2);
      samples[i] = image.smoothed->at(image.per_pixel * (p.x + at * normal.x), image.per_pixel * (p.y + at * normal.y));
    }
    const TubeTemplates::Fit fit = tube.fit(samples);
    if (!(fit.contrast > 0)) return point;
    point.contrast = fit.contrast;
    point.misfit = fit.misfit;
    point.offset += std::clamp(fit.shift, -0.5f * tube.radius, 0.5f * tube.radius);
    point.radius =
        std::clamp(tube.radius + std::clamp(fit.growth, -0.3f * tube.radius, 0.4f * tube.radius), kThinnest, largest_);
    const float noise = scales.noiseAt(image, p);
    const float correlated = std::sqrt(std::max(1.0f, kCorrelation * image.sigma / tube.step));
    const float excess = std::sqrt(std::max(0.0f, point.misfit * point.misfit - kChance * noise * noise));
    point.sigma = noise * correlated * tube.shift_noise / fit.contrast;
    point.bias = kBias * excess / fit.contrast * point.radius;
    point.valid = std::abs(point.offset) < std::max(1.5f, 0.8f * point.radius) &&
                  fit.contrast > 2 * noise * tube.contrast_noise && point.misfit < kWorstMisfit * fit.contrast + noise;
  }
  return point;
}

// Also finds how far the junctions at the track's ends reach: to where tubes begin to fit.
std::vector<RidgeFitting::Point> RidgeFitting::fitAlong(const SkeletonGraph& graph, const RidgeScales& scales,
                                                        Track& track) const {
  const std::size_t n = track.line.size();
  const auto crosses = [&](const cv::Point2f& p) {
    return std::any_of(graph.crossings.begin(), graph.crossings.end(),
                       [&](const auto& c) { return cv::norm(p - c.position) < c.radius; });
  };
  std::vector<Point> points(n);
  for (std::size_t i = 0; i < n; i += kFitEvery) {
    if (crosses(track.line[i])) continue;
    const auto reach = static_cast<std::size_t>(std::max(3.0f, 0.7f * track.radius[i]));
    points[i] = fitAt(scales, track.line[i], directionAt(track.line, i, reach), track.radius[i]);
  }
  const auto fits = [&](std::size_t i) { return i >= n || points[i - i % kFitEvery].valid; };
  const auto reachFrom = [&](int node, const auto& place) {
    const std::size_t most = reachOf(graph, node, n);
    std::size_t reach = 0;
    while (reach < most && !(fits(place(reach)) && fits(place(reach + 2)) && fits(place(reach + 4)))) ++reach;
    return reach;
  };
  track.begin_reach = reachFrom(track.begin, [](std::size_t i) { return i; });
  track.end_reach = reachFrom(track.end, [n](std::size_t i) { return i < n ? n - 1 - i : n; });
  for (std::size_t i = 0; i < track.begin_reach; ++i) points[i].valid = false;
  for (std::size_t i = n - track.end_reach; i < n; ++i) points[i].valid = false;
  return points;
}

// Takes off what thinning leaves at blunt tips, and what runs on into the background: there no tube fits, or one that
// is much fainter than the line next to it.
void RidgeFitting::trim(Track& track, std::vector<Point>& points) {
  if (track.closed) return;
  const auto n = static_cast<std::ptrdiff_t>(points.size());
  const auto taken = [&](const auto& place, float radius) {
    std::vector<float> contrasts;
    for (std::ptrdiff_t i = 0; i < n && contrasts.size() < kTipFits; ++i) {
      if (points[place(i)].valid) contrasts.push_back(points[place(i)].contrast);
    }
    if (contrasts.size() < kFewFits) return std::ptrdiff_t{0};
    const auto middle = contrasts.begin() + static_cast<std::ptrdiff_t>(contrasts.size() / 2);
    std::nth_element(contrasts.begin(), middle, contrasts.end());
    const auto fits = [&](std::ptrdiff_t i) {
      const Point& p = points[place(i) - place(i) % kFitEvery];
      return p.valid && p.contrast > kTailContrast * *middle;
    };
    const auto most = std::min<std::ptrdiff_t>(n / 3, std::lround(kTailRadii * radius + 4));
    std::ptrdiff_t count = 0;
    while (count < most && !fits(count)) ++count;
    return count;
  };
  std::ptrdiff_t first = 0, last = n;
  if (track.begin < 0) first = taken([](std::ptrdiff_t i) { return i; }, track.radius.front());
  if (track.end < 0) last = n - taken([n](std::ptrdiff_t i) { return n - 1 - i; }, track.radius.back());
  first -= first % kFitEvery;
  const auto keep = [&](auto& values) {
    values.erase(values.begin() + last, values.end());
    values.erase(values.begin(), values.begin() + first);
  };
  keep(track.line);
  keep(track.radius);
  keep(points);
}

// Averages the fits along the line and moves it; every point then has all values.
void RidgeFitting::recentre(Track& track, std::vector<Point>& points, float filter) const {
  const auto n = static_cast<std::ptrdiff_t>(points.size());
  std::vector<Point> averaged(points.size());
  Polyline moved = track.line;
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    const float sigma = std::max(filter, 0.5f * track.radius[i]);
    averaged[i].radius = averaged[i].sigma = track.radius[i];  // Far from every fit nothing better is known.
    for (float widening = 1; widening < 20; widening *= 2) {
      const auto reach = static_cast<std::ptrdiff_t>(2.5f * sigma * widening);
      float total = 0, weights = 0, weights2 = 0, offset = 0, variance = 0;
      Point mean;
      for (std::ptrdiff_t j = std::max<std::ptrdiff_t>(0, i - reach); j <= std::min(n - 1, i + reach); ++j) {
        const Point& p = points[j];
        if (!p.valid) continue;
        const float d = static_cast<float>(j - i) / (sigma * widening), near = std::exp(-0.5f * d * d);
        const float sure = near / (p.sigma * p.sigma + p.bias * p.bias + kModelSigma * kModelSigma);
        total += sure;
        offset += sure * p.offset;
        mean.bias += near * p.bias;
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
      to.offset = offset / total;
      to.radius = (mean.radius - 1) / weights;
      to.contrast = mean.contrast / weights;
      to.misfit = mean.misfit / weights;
      to.bias = mean.bias / weights;
      // Noise is the same over some pixels along the line as well: averaging gains less than the number of fits.
      const float independent = std::max(1.0f, weights * weights / weights2 * kFitEvery / kCorrelation);
      to.sigma = std::hypot(widening * std::sqrt(variance / total / independent + kModelSigma * kModelSigma), to.bias);
      const cv::Point2f along = directionAt(track.line, static_cast<std::size_t>(i), 3);
      moved[i] += to.offset * cv::Point2f(-along.y, along.x);
      break;
    }
  }
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    if (averaged[i].valid) track.radius[i] = averaged[i].radius;
  }
  track.line = std::move(moved);
  points = std::move(averaged);
}

CentreLine RidgeFitting::finished(const SkeletonGraph& graph, const Track& track,
                                  const std::vector<Point>& points) const {
  CentreLine result;
  result.line = track.line;
  for (const Point& p : points) {
    result.radius.push_back(p.radius);
    result.sigma.push_back(p.sigma);
    result.contrast.push_back(p.contrast);
  }
  const std::size_t n = points.size();
  for (std::size_t i = 0; i < track.begin_reach && i < n; ++i) {
    result.sigma[i] = std::max(result.sigma[i], kGuess * graph.nodes[track.begin].radius);
  }
  for (std::size_t i = 0; i < track.end_reach && i < n; ++i) {
    result.sigma[n - 1 - i] = std::max(result.sigma[n - 1 - i], kGuess * graph.nodes[track.end].radius);
  }
  if (track.closed) {
    result.line.push_back(result.line.front());
    for (auto* values : {&result.radius, &result.sigma, &result.contrast}) values->push_back(values->front());
  }
  return result;
}

std::vector<CentreLine> RidgeFitting::operator()(const SkeletonGraph& graph, const RidgeScales& scales) const {
  std::vector<Track> tracks;
  std::vector<std::vector<Point>> fits;
  for (std::size_t b = 0; b < graph.branches.size(); ++b) {
    const auto& branch = graph.branches[b];
    if (!branch.alive || (branch.line.size() < 2 && branch.begin < 0)) continue;
    float radius = 0;
    for (const cv::Point2f& p : branch.line) radius += scales.radius().at(p.x, p.y);
    radius /= static_cast<float>(branch.line.size() + 1);
    const float stair =
        std::min(std::max(kStairFilter, 0.7f * radius), 0.2f * static_cast<float>(branch.line.size()) + 1);
    Track track = trackOf(graph, branch, stair);
    track.branch = static_cast<int>(b);
    float last = std::max(radius, kThinnest);
    for (const cv::Point2f& p : track.line) {
      const float here = scales.radius().at(p.x, p.y);
      if (here > 0) last = here;
      track.radius.push_back(last);
    }
    auto points = fitAlong(graph, scales, track);
    if (std::none_of(points.begin(), points.end(), [](const Point& p) { return p.valid; })) continue;
    recentre(track, points, kOffsetFilter);
    points = fitAlong(graph, scales, track);
    if (std::none_of(points.begin(), points.end(), [](const Point& p) { return p.valid; })) continue;
    trim(track, points);
    recentre(track, points, kOffsetFilter);
    tracks.push_back(std::move(track));
    fits.push_back(std::move(points));
  }
  meet(graph, tracks);
  std::vector<CentreLine> lines;
  for (std::size_t t = 0; t < tracks.size(); ++t) lines.push_back(finished(graph, tracks[t], fits[t]));
  return lines;
}

}  // namespace angio
