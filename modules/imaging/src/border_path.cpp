// SPDX-License-Identifier: GPL-2.0-or-later
#include "border_path.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "line_profiles.hpp"
#include "tracks.hpp"

namespace angio::imaging {
namespace {

// So much of a catheter at the border may have no line [working px].
constexpr float kUnseen = 8;
// Directions at an end are taken over so many points, and over more where pieces are compared.
constexpr std::size_t kEndReach = 8, kPieceReach = 16;
// A piece goes on from another one's end where it begins so near [working px], and within 40 deg of straight on.
constexpr float kNextGap = 8, kStraightOn = 0.77f;
// It is as wide within this factor.
constexpr float kAsWide = 1.3f;
// What is alike may be interrupted over so many points.
constexpr std::size_t kInterruption = 2 * kWindow;
// From so many radii before a point to so many after it a catheter turns by 50 deg at most: the curves that it is made
// with have radii of several of its own diameters. Lines may follow the border, or what else lies beside it, first, for
// so many points, to where they turn by more than a piece that goes on.
constexpr float kBendReach = 3, kSharpBend = 0.64f;
constexpr std::size_t kAlongBorder = 48;

void reverse(CentreLine& line) {
  std::reverse(line.line.begin(), line.line.end());
  for (auto* values : {&line.radius, &line.sigma, &line.contrast}) std::reverse(values->begin(), values->end());
}

void append(CentreLine& line, const CentreLine& next) {
  line.line.insert(line.line.end(), next.line.begin(), next.line.end());
  line.radius.insert(line.radius.end(), next.radius.begin(), next.radius.end());
  line.sigma.insert(line.sigma.end(), next.sigma.begin(), next.sigma.end());
  line.contrast.insert(line.contrast.end(), next.contrast.begin(), next.contrast.end());
}

// Whether a line begins at the border, or would if it began a little earlier: its first points are the hardest to see.
bool comesIn(const Polyline& line, const std::vector<RowRange>& open) {
  const cv::Point2f along = directionAt(line, 0, kEndReach);
  return atBorder(line.front(), open) || atBorder(line.front() - kUnseen * along, open);
}

// The piece that goes on straightest from the path's end, if its width is the path's.
BorderPath::Piece nextPiece(const std::vector<CentreLine>& lines, const BorderPath& path) {
  const Polyline& so_far = path.whole.line;
  const cv::Point2f tip = so_far.back(), along = directionAt(so_far, so_far.size() - 1, kPieceReach);
  const std::size_t window = std::min(so_far.size(), 2 * kWindow);
  const float width = medianWithin(path.whole.radius, so_far.size() - window, so_far.size());
  BorderPath::Piece next{lines.size(), 0, false};
  float straightest = kStraightOn;
  for (std::size_t other = 0; other < lines.size(); ++other) {
    const CentreLine& line = lines[other];
    const std::size_t n = line.line.size();
    if (path.has(other) || line.kind == CurveKind::kDevice || n < kWindow) continue;
    for (const bool reversed : {false, true}) {
      const cv::Point2f end = reversed ? line.line.back() : line.line.front();
      if (cv::norm(end - tip) > kNextGap) continue;
      const cv::Point2f onward =
          reversed ? -directionAt(line.line, n - 1, kPieceReach) : directionAt(line.line, 0, kPieceReach);
      const float radius = medianWithin(line.radius, reversed ? n - kWindow : 0, reversed ? n : kWindow);
      const float straight = along.dot(onward);
      if (straight < straightest || radius > kAsWide * width || width > kAsWide * radius) continue;
      straightest = straight;
      next = {other, n, reversed};
    }
  }
  return next;
}

// Whether a path bends at a point by more than an angle of this cosine.
bool bendsAt(const CentreLine& path, std::size_t i, float straight) {
  const Polyline& line = path.line;
  const auto reach = static_cast<std::size_t>(std::max(kBendReach * path.radius[i], static_cast<float>(kEndReach)));
  if (i < reach || i + reach >= line.size()) return false;
  const cv::Point2f before = line[i] - line[i - reach], after = line[i + reach] - line[i];
  return before.dot(after) < straight * static_cast<float>(cv::norm(before) * cv::norm(after));
}

void findBends(BorderPath& path) {
  const std::size_t n = path.whole.line.size();
  for (std::size_t i = 0; i < std::min(n, kAlongBorder); ++i) {
    if (bendsAt(path.whole, i, kStraightOn)) path.begin = i;
  }
  path.bend = std::min(n, kAlongBorder);
  while (path.bend < n && !bendsAt(path.whole, path.bend, kSharpBend)) ++path.bend;
}

}  // namespace

bool BorderPath::has(std::size_t line) const {
  return std::any_of(pieces.begin(), pieces.end(), [&](const Piece& piece) { return piece.line == line; });
}

BorderPath pathFromBorder(const std::vector<CentreLine>& lines, std::size_t own, const std::vector<RowRange>& open) {
  BorderPath path;
  path.whole = lines[own];
  bool reversed = false;
  if (!comesIn(path.whole.line, open)) {
    reversed = true;
    reverse(path.whole);
    if (!comesIn(path.whole.line, open)) return {};
  }
  path.pieces.push_back({own, lines[own].line.size(), reversed});
  for (auto next = nextPiece(lines, path); next.line < lines.size(); next = nextPiece(lines, path)) {
    CentreLine piece = lines[next.line];
    if (next.reversed) reverse(piece);
    append(path.whole, piece);
    path.pieces.push_back(next);
  }
  findBends(path);
  return path;
}

std::size_t evenUntil(const BorderPath& path, std::size_t begin, const IsAlike& alike) {
  std::size_t end = begin;
  for (std::size_t from = begin; from + kWindow <= path.bend && alike(from, from + kWindow); from += kWindowStep) {
    end = from + kWindow;
  }
  return end > begin && path.bend - end < kWindowStep ? path.bend : end;
}

std::size_t alikeUntil(const BorderPath& path, std::size_t begin, std::size_t run, const IsAlike& alike) {
  std::size_t end = evenUntil(path, begin, alike);
  for (std::size_t from = begin; from + kWindow <= path.bend && from < end + kInterruption; from += kWindowStep) {
    const std::size_t next = evenUntil(path, from, alike);
    if (next > end && (next - from >= run || from <= end)) end = next;
  }
  return end;
}

}  // namespace angio::imaging
