// SPDX-License-Identifier: GPL-2.0-or-later
#include "ridge_lines.hpp"

#include <algorithm>
#include <opencv2/core.hpp>

namespace angio::imaging {
namespace {

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
