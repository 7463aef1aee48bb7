// SPDX-License-Identifier: GPL-2.0-or-later
// One profile after the other.
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <utility>

#include "quantile.hpp"
#include "ridge_lines.hpp"

namespace angio::imaging {
namespace {

// Of Gauss and Newton at each point; one is enough if it changes middle and radius by less than this part of the
// radius.
constexpr int kSteps = 2;
constexpr float kSmallStep = 0.25f;

// What else than noise a fit leaves, in its contrast, moves the middle by so many radii: another vessel or a bone's
// edge on its flank. Squared misfits of up to this many times the noise's are chance.
constexpr float kBias = 4, kChance = 1.3f;

// A tube leaves less than this part of its contrast where it is alone.
constexpr float kWorstMisfit = 0.2f;

// A vessel ends where it is fainter than this part of what it is over the fits next to its end. What is taken off is
// not longer than this many radii.
constexpr float kTailContrast = 0.6f, kTailRadii = 3;
constexpr std::size_t kFewFits = 6;
constexpr std::size_t kTipFits = 16;

// A fit whose middle is so near to the line [working px] is as good as one from there. A profile's samples reach so
// far.
constexpr float kOnLine = 0.3f, kProfileRadii = 2;

// Templates are thinner than this many radii of the image's own blur.
constexpr float kBlurPart = 0.35f;

// Values of an image at places `step` apart about the middle one.
void sample(const Plane& image, const cv::Point2f& middle, const cv::Point2f& step,
            std::array<float, TubeTemplates::kSamples>& samples) {
  constexpr int kHalf = TubeTemplates::kSamples / 2;
  const cv::Point2f first = middle - kHalf * step, last = middle + kHalf * step;
  const bool within = image.contains(first.x, first.y) && image.contains(last.x, last.y);
  for (int i = 0; i < TubeTemplates::kSamples; ++i) {
    const cv::Point2f at = middle + static_cast<float>(i - kHalf) * step;
    samples[i] = within ? image.within(at.x, at.y) : image.at(at.x, at.y);
  }
}

}  // namespace

RidgeFitting::RidgeFitting(float max_radius, const RidgeScales& scales)
    : templates_(kThinnest, 1.6f * max_radius,
                 [&](float radius) {
                   const float sigma = scales.sigmaUpTo(kBlurPart * radius);
                   // A pixel averages over its own square, and so does the interpolation between two of them.
                   return std::sqrt(sigma * sigma + 1.0f / 6);
                 }),
      largest_(1.6f * max_radius) {}

RidgeFitting::Point RidgeFitting::fitAt(const RidgeScales& scales, const Place& place, Others others) const {
  const cv::Point2f& p = place.position;
  const cv::Point2f normal(-place.along.y, place.along.x);
  Point point;
  point.radius = std::clamp(place.radius, kThinnest, largest_);
  std::array<float, TubeTemplates::kSamples> samples;
  for (int step = 0; step < kSteps; ++step) {
    const TubeTemplates::Template& tube = templates_.nearest(point.radius);
    const ScaleImage image = scales.imageUpTo(kBlurPart * tube.radius);
    const cv::Point2f middle = p + point.offset * normal;
    sample(*image.smoothed, image.per_pixel * middle, image.per_pixel * tube.step * normal, samples);
    if (others == Others::kTakenAway) {
      shadows_.subtractOthers(place.tube, {middle, normal, tube.step, tube.blur, TubeTemplates::kSamples},
                              samples.data());
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
    if (std::max(std::abs(fit.shift), std::abs(fit.growth)) < kSmallStep * tube.radius) break;
  }
  return point;
}

void RidgeFitting::fitAlong(const SkeletonGraph& graph, const RidgeScales& scales, Fitted& line, int tube,
                            Others others) const {
  const Track& track = line.track;
  const std::size_t n = track.line.size();
  // Where vessels cross, one alone cannot be fitted.
  const auto hidden = [&](const cv::Point2f& p) {
    return others == Others::kStay && std::any_of(graph.crossings.begin(), graph.crossings.end(),
                                                  [&](const auto& c) { return cv::norm(p - c.position) < c.radius; });
  };
  line.fits.resize(n);
  for (std::size_t i = 0; i < n; i += kFitEvery) {
    const Point before = std::exchange(line.fits[i], {});
    // Where a vessel is alone, it was fitted alone.
    if (others == Others::kTakenAway && before.valid && std::abs(before.offset) < kOnLine &&
        !shadows_.othersNear(tube, track.line[i], kProfileRadii * track.radius[i])) {
      line.fits[i] = before;
      continue;
    }
    if (hidden(track.line[i])) continue;
    const auto reach = static_cast<std::size_t>(std::max(3.0f, 0.7f * track.radius[i]));
    line.fits[i] = fitAt(scales, {tube, track.line[i], directionAt(track.line, i, reach), track.radius[i]}, others);
  }
  findReaches(graph, line);
}

// How far the junctions at the track's ends reach: to where tubes begin to fit.
void RidgeFitting::findReaches(const SkeletonGraph& graph, Fitted& line) {
  Track& track = line.track;
  std::vector<Point>& points = line.fits;
  const std::size_t n = track.line.size();
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
}

// Leaves out what thinning leaves at blunt tips, and what runs on into the background: there no tube fits, or one that
// is much fainter than the line next to it.
void RidgeFitting::findEnds(Fitted& line) {
  const Track& track = line.track;
  const std::vector<Point>& points = line.fits;
  const auto n = static_cast<std::ptrdiff_t>(points.size());
  const auto taken = [&](const auto& place, float radius) {
    std::vector<float> contrasts;
    for (std::ptrdiff_t i = 0; i < n && contrasts.size() < kTipFits; ++i) {
      if (points[place(i)].valid) contrasts.push_back(points[place(i)].contrast);
    }
    if (contrasts.size() < kFewFits) return std::ptrdiff_t{0};
    const float middle = medianOf(std::move(contrasts));
    const auto fits = [&](std::ptrdiff_t i) {
      const Point& p = points[place(i) - place(i) % kFitEvery];
      return p.valid && p.contrast > kTailContrast * middle;
    };
    const auto most = std::min<std::ptrdiff_t>(n / 3, std::lround(kTailRadii * radius + 4));
    std::ptrdiff_t count = 0;
    while (count < most && !fits(count)) ++count;
    return count;
  };
  line.first = 0;
  line.last = n;
  if (track.closed) return;
  if (track.begin < 0) line.first = taken([](std::ptrdiff_t i) { return i; }, track.radius.front());
  if (track.end < 0) line.last = n - taken([n](std::ptrdiff_t i) { return n - 1 - i; }, track.radius.back());
}

void RidgeFitting::trim(Fitted& line) {
  const auto keep = [&](auto& values) {
    values.erase(values.begin() + line.last, values.end());
    values.erase(values.begin(), values.begin() + line.first);
  };
  keep(line.track.line);
  keep(line.track.radius);
  keep(line.points);
}

}  // namespace angio::imaging
