// SPDX-License-Identifier: GPL-2.0-or-later
#include "ridge_lines.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <utility>

#include "quantile.hpp"

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
// Where a vessel is expected it may be fainter at its end, and its middle is no further away than this [working px]:
// what is found there is another vessel.
constexpr float kExpectedTailContrast = 0.3f, kExpectedOffset = 1.5f;
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

// Takes the staircase of the pixel grid out of a line [working px], and [radii]. More would cut corners.
constexpr float kStairFilter = 1.5f, kStairRadii = 0.4f;

// Where vessels meet, a line's way is a guess, and is wrong by this part of the junction's radius.
constexpr float kGuess = 0.3f;

// A ring that is no longer than so many radii lies within its vessel.
constexpr float kRingRadii = 4;

// Whether no tube fits anywhere.
template <typename Points>
bool noneValid(const Points& points) {
  return std::none_of(points.begin(), points.end(), [](const auto& p) { return p.valid; });
}

}  // namespace

RidgeFitting::RidgeFitting(float max_radius, const RidgeScales& scales)
    : templates_(kThinnest, 1.6f * max_radius,
                 [&](float radius) {
                   const float sigma = scales.sigmaUpTo(kBlurPart * radius);
                   // A pixel averages over its own square, and so does the interpolation between two of them.
                   return std::sqrt(sigma * sigma + 1.0f / 6);
                 }),
      max_radius_(1.6f * max_radius) {}

RidgeFitting::Point RidgeFitting::fitAt(const RidgeScales& scales, const Place& place, Others others) const {
  const cv::Point2f& p = place.position;
  const cv::Point2f normal(-place.along.y, place.along.x);
  Point point;
  point.radius = std::clamp(place.radius, kThinnest, max_radius_);
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
    point.radius = std::clamp(tube.radius + std::clamp(fit.growth, -0.3f * tube.radius, 0.4f * tube.radius), kThinnest,
                              max_radius_);
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
    return others == Others::kStay && std::any_of(graph.crossings.begin(), graph.crossings.end(), [&](const auto& c) {
             const cv::Point2f to = p - c.position;
             return std::max(std::abs(to.x), std::abs(to.y)) < c.radius && cv::norm(to) < c.radius;
           });
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
    Point& fit = line.fits[i];
    fit = fitAt(scales, {tube, track.line[i], directionAt(track.line, i, reach), track.radius[i]}, others);
    fit.valid = fit.valid && !(track.expected && std::abs(fit.offset) > kExpectedOffset);
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
  const float tail = track.expected ? kExpectedTailContrast : kTailContrast;
  const auto taken = [&](const auto& place, float radius) {
    std::vector<float> contrasts;
    for (std::ptrdiff_t i = 0; i < n && contrasts.size() < kTipFits; ++i) {
      if (points[place(i)].valid) contrasts.push_back(points[place(i)].contrast);
    }
    if (contrasts.size() < kFewFits) return std::ptrdiff_t{0};
    const float middle = medianOf(contrasts);
    const auto fits = [&](std::ptrdiff_t i) {
      const Point& p = points[place(i) - place(i) % kFitEvery];
      return p.valid && p.contrast > tail * middle;
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

CentreLine RidgeFitting::finished(const SkeletonGraph& graph, const Fitted& fitted) const {
  const Track& track = fitted.track;
  const std::vector<Point>& points = fitted.points;
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

// With the radii that the scales say.
Track RidgeFitting::trackOn(const SkeletonGraph& graph, std::size_t index, const RidgeScales& scales) const {
  const SkeletonGraph::Branch& branch = graph.branches[index];
  float radius = 0;
  for (const cv::Point2f& p : branch.line) radius += scales.radius().at(p.x, p.y);
  radius /= static_cast<float>(branch.line.size() + 1);
  const float stair =
      std::min(std::max(kStairFilter, kStairRadii * radius), 0.2f * static_cast<float>(branch.line.size()) + 1);
  Track track = trackOf(graph, branch, stair);
  track.branch = static_cast<int>(index);
  track.expected = branch.expected;
  float last = std::max(radius, kThinnest);
  for (const cv::Point2f& p : track.line) {
    const float here = scales.radius().at(p.x, p.y);
    if (here > 0) last = here;
    track.radius.push_back(last);
  }
  return track;
}

std::vector<RidgeFitting::Fitted> RidgeFitting::fittedAlone(const SkeletonGraph& graph, const RidgeScales& scales) {
  std::vector<Fitted> lines;
  for (std::size_t b = 0; b < graph.branches.size(); ++b) {
    const auto& branch = graph.branches[b];
    if (!branch.alive || (branch.line.size() < 2 && branch.begin < 0)) continue;
    Fitted line;
    line.track = trackOn(graph, b, scales);
    fitAlong(graph, scales, line, 0, Others::kStay);
    if (noneValid(line.fits)) continue;
    recenter(line);
    average(line);
    lines.push_back(std::move(line));
  }
  return lines;
}

// Within a junction nothing is known of a tube: what vessels share there is no sum.
std::vector<TubeShadows::Piece> RidgeFitting::piecesOf(const Fitted& line) {
  const Track& track = line.track;
  const std::size_t n = track.line.size();
  std::vector<TubeShadows::Piece> pieces(n);
  for (std::size_t i = track.begin_reach; i + track.end_reach < n; ++i) {
    if (!line.points[i].valid) continue;
    pieces[i] = {track.line[i], directionAt(track.line, i, 3), line.points[i].radius, line.points[i].contrast};
  }
  return pieces;
}

void RidgeFitting::fitTogether(const SkeletonGraph& graph, const RidgeScales& scales, std::vector<Fitted>& lines) {
  for (std::size_t t = 0; t < lines.size(); ++t) {
    Fitted& line = lines[t];
    const int tube = static_cast<int>(t);
    if (line.points.empty()) continue;
    fitAlong(graph, scales, line, tube, Others::kTakenAway);
    if (noneValid(line.fits)) {
      shadows_.replace(tube, std::vector<TubeShadows::Piece>(line.points.size()));
      line.points.clear();
      continue;
    }
    findEnds(line);
    recenter(line);
    average(line);
    shadows_.replace(tube, piecesOf(line));
  }
}

// Whether no tube fits a line, or it does not leave the vessel that it begins in: a fork or a ring at a blunt tip.
bool RidgeFitting::isNothing(const Fitted& line) {
  if (line.points.empty()) return true;
  const Track& track = line.track;
  const float length = static_cast<float>(line.last - line.first), radius = std::max(track.radius.front(), 2.0f);
  if (track.begin >= 0 && track.begin == track.end) return length < kRingRadii * radius;
  return !track.closed && (track.begin < 0 || track.end < 0) && length < radius;
}

std::vector<CentreLine> RidgeFitting::operator()(const SkeletonGraph& graph, const RidgeScales& scales) {
  std::vector<Fitted> lines = fittedAlone(graph, scales);
  std::vector<std::vector<TubeShadows::Piece>> tubes;
  for (const Fitted& line : lines) tubes.push_back(piecesOf(line));
  shadows_.set({scales.strength().width(), scales.strength().height()}, std::move(tubes));
  fitTogether(graph, scales, lines);
  lines.erase(std::remove_if(lines.begin(), lines.end(), isNothing), lines.end());
  std::vector<Track> tracks;
  for (Fitted& line : lines) {
    trim(line);
    tracks.push_back(line.track);
  }
  meet(graph, tracks);
  std::vector<CentreLine> result;
  for (std::size_t t = 0; t < lines.size(); ++t) {
    lines[t].track.line = std::move(tracks[t].line);
    result.push_back(finished(graph, lines[t]));
  }
  return result;
}

}  // namespace angio::imaging
