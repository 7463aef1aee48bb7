// SPDX-License-Identifier: GPL-2.0-or-later
#include "expected_lines.hpp"

#include <Eigen/Core>
#include <algorithm>

#include "line_motion.hpp"

namespace angio::imaging {
namespace {

// Directions are over so many points to both sides.
constexpr std::size_t kAlongReach = 3;
// A line has been found when it is so near [working px].
constexpr double kFound_px = 1.5;
// Shorter parts are what a bend leaves [points].
constexpr std::size_t kShortest = 4;
// A line is expected when this part of it runs along.
constexpr double kMost = 0.7;

Eigen::Vector2d vectorOf(const cv::Point2f& p) { return {p.x, p.y}; }

LinePoint pointOf(const Polyline& line, std::size_t i) {
  return {vectorOf(line[i]), vectorOf(directionAt(line, i, kAlongReach))};
}

void addPoints(PlacedLines& placed, const Polyline& line) {
  for (std::size_t i = 0; i < line.size(); ++i) placed.add(pointOf(line, i));
}

void bringOnto(const PlacedLines& found, std::vector<Polyline>& lines) {
  std::vector<LinePoint> tried;
  std::vector<Eigen::Vector2d> points;
  for (const Polyline& line : lines) {
    for (std::size_t i = 0; i < line.size(); i += 2) tried.push_back(pointOf(line, i));
    for (const cv::Point2f& p : line) points.push_back(vectorOf(p));
  }
  const AffineMove move = AffineMove::onto(found, tried, points);
  for (Polyline& line : lines) {
    for (cv::Point2f& p : line) {
      const Eigen::Vector2d by = move.by(vectorOf(p));
      p += cv::Point2f(static_cast<float>(by.x()), static_cast<float>(by.y()));
    }
  }
}

}  // namespace

ExpectedLines::ExpectedLines(const Centerline2d& expected, const WorkingGrid& grid)
    : within_(1, 1, static_cast<float>(grid.size.width) - 2, static_cast<float>(grid.size.height) - 2) {
  Polyline line;
  const auto close = [&] {
    Polyline even;
    if (line.size() > 1) {
      for (const float place : equalSteps(line, 1)) even.push_back(at(line, place));
    }
    if (!even.empty()) lines_.push_back(std::move(even));
    line.clear();
  };
  for (int i = 0; i < expected.size(); ++i) {
    if (i > 0 && expected.branch[i] != expected.branch[i - 1]) close();
    const Eigen::Vector2f p = expected.points_px.col(i).cast<float>();
    const cv::Point2f working = grid.toWorking({p.x(), p.y()});
    if (within_.contains(working)) {
      line.push_back(working);
    } else {
      close();
    }
  }
  close();
}

void ExpectedLines::addTo(SkeletonGraph& graph) {
  PlacedLines found;
  for (const auto& branch : graph.branches) {
    if (branch.alive) addPoints(found, branch.line);
  }
  found.place();
  bringOnto(found, lines_);
  for (const Polyline& line : lines_) {
    Polyline missing;
    for (std::size_t i = 0; i <= line.size(); ++i) {
      if (i < line.size() && within_.contains(line[i]) && found.along(pointOf(line, i), kFound_px) < 0) {
        missing.push_back(line[i]);
        continue;
      }
      if (missing.size() >= kShortest) {
        SkeletonGraph::Branch& branch = graph.branches.emplace_back();
        branch.line = missing;
        branch.expected = true;
      }
      missing.clear();
    }
  }
}

void ExpectedLines::markIn(std::vector<CentreLine>& lines) const {
  PlacedLines expected;
  for (const Polyline& line : lines_) addPoints(expected, line);
  expected.place();
  for (CentreLine& line : lines) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < line.line.size(); ++i)
      count += expected.along(pointOf(line.line, i), kFound_px) >= 0 ? 1 : 0;
    line.expected = static_cast<double>(count) > kMost * static_cast<double>(line.line.size());
  }
}

}  // namespace angio::imaging
