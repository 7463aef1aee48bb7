// SPDX-License-Identifier: GPL-2.0-or-later
#include "ridge_lines.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

namespace angio {
namespace {

constexpr float kStairFilter = 2.5f;   // Takes the staircase of the pixel grid out of a line [working px].
constexpr float kOffsetFilter = 1.5f;  // Over how far fits are averaged [working px], or over 0.5 radii.

// What no noise explains: vessels bend, taper and are not round [working px].
constexpr float kModelSigma = 0.025f;

// Where vessels meet, a line's way is a guess, and is wrong by this part of the junction's radius.
constexpr float kGuess = 0.3f;

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

// A ring that is no longer than so many radii lies within its vessel.
constexpr float kRingRadii = 4;

// Whether no tube fits anywhere.
template <typename Points>
bool noneValid(const Points& points) {
  return std::none_of(points.begin(), points.end(), [](const auto& p) { return p.valid; });
}

}  // namespace

// Averages the fits along the line and moves it; every point then has all values.
void RidgeFitting::recentre(Fitted& line, float filter) {
  Track& track = line.track;
  const std::vector<Point>& points = line.fits;
  const auto n = static_cast<std::ptrdiff_t>(points.size());
  std::vector<Point> averaged(points.size());
  Polyline moved = track.line;
  static const Bell bell;
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    const float sigma = std::max(filter, 0.5f * track.radius[i]);
    averaged[i].radius = averaged[i].sigma = track.radius[i];  // Far from every fit nothing better is known.
    for (float widening = 1; widening < 20; widening *= 2) {
      const auto reach = static_cast<std::ptrdiff_t>(Bell::kReach * sigma * widening);
      float total = 0, weights = 0, weights2 = 0, offset = 0, variance = 0;
      Point mean;
      const float per_point = 1 / (sigma * widening);
      const std::ptrdiff_t begin = std::max<std::ptrdiff_t>(0, i - reach), end = std::min(n - 1, i + reach);
      for (std::ptrdiff_t j = (begin + kFitEvery - 1) / kFitEvery * kFitEvery; j <= end; j += kFitEvery) {
        const Point& p = points[j];
        if (!p.valid) continue;
        const float near = bell(static_cast<float>(std::abs(j - i)) * per_point);
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
  line.points = std::move(averaged);
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
      std::min(std::max(kStairFilter, 0.7f * radius), 0.2f * static_cast<float>(branch.line.size()) + 1);
  Track track = trackOf(graph, branch, stair);
  track.branch = static_cast<int>(index);
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
    Fitted line{trackOn(graph, b, scales), {}, {}};
    fitAlong(graph, scales, line, 0, Others::kStay);
    if (noneValid(line.fits)) continue;
    recentre(line, kOffsetFilter);
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
    recentre(line, kOffsetFilter);
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

}  // namespace angio
