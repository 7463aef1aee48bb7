// SPDX-License-Identifier: GPL-2.0-or-later
#include "expected_lines.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>

#include "angio/geometry/bucket_grid.hpp"

namespace angio::imaging {
namespace {

using geometry::BucketGrid;

// Lines run along each other at less than 30 degrees (cosine). Directions are over so many points to both sides.
constexpr double kAlong = 0.87;
constexpr std::size_t kAlongReach = 3;
// A line is sought so far from where it is expected; and has been found when it is so near, all [working px].
constexpr double kSought_px = 6, kFound_px = 1.5;
// Shorter parts are what a bend leaves [points].
constexpr std::size_t kShortest = 4;
// Of the affine map: this many places say enough; what lies further off than this says nothing after the first round;
// and no place is moved by more [working px].
constexpr std::size_t kFewMatches = 60;
constexpr double kOff_px = 3, kMaxMove_px = 10;
constexpr int kRounds = 4;
// Weight of a map that moves nothing, over that of the matches.
constexpr double kStays = 1e-3;
// A line is expected when this part of it runs along.
constexpr double kMost = 0.7;

Eigen::Vector2d vectorOf(const cv::Point2f& p) { return {p.x, p.y}; }

// The points of some lines, to be asked what runs along a place.
class PlacedLines {
 public:
  void add(const Polyline& line) {
    for (std::size_t i = 0; i < line.size(); ++i) {
      points_.push_back({vectorOf(line[i]), vectorOf(directionAt(line, i, kAlongReach))});
    }
  }

  void place() {
    Eigen::Matrix2Xd at(2, static_cast<Eigen::Index>(points_.size()));
    for (std::size_t i = 0; i < points_.size(); ++i) at.col(static_cast<Eigen::Index>(i)) = points_[i].at;
    grid_.build(at);
  }

  struct Point {
    Eigen::Vector2d at, direction;
  };

  // The nearest one that runs along; null without one.
  const Point* along(const Polyline& line, std::size_t i, double reach_px) const {
    const Eigen::Vector2d direction = vectorOf(directionAt(line, i, kAlongReach));
    double best2 = reach_px * reach_px;
    const Point* nearest = nullptr;
    grid_.eachWithin(vectorOf(line[i]), reach_px, [&](int index, double x, double y) {
      const Point& point = points_[static_cast<std::size_t>(index)];
      if (x * x + y * y > best2 || std::abs(point.direction.dot(direction)) < kAlong) return;
      best2 = x * x + y * y;
      nearest = &point;
    });
    return nearest;
  }

 private:
  std::vector<Point> points_;
  BucketGrid grid_;
};

// How far a line lies from where it is expected, across it: linear in the six numbers of an affine map.
struct Offset {
  Eigen::Matrix<double, 6, 1> by_map;
  double offset_px;
};

// Places in units of half the extent about the middle, so that all six numbers are pixels at the lines' ends.
class AffineMove {
 public:
  explicit AffineMove(const std::vector<Polyline>& lines) {
    Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9), high = -low;
    for (const Polyline& line : lines) {
      for (const cv::Point2f& p : line) {
        low = low.cwiseMin(vectorOf(p));
        high = high.cwiseMax(vectorOf(p));
      }
    }
    middle_ = 0.5 * (low + high);
    unit_px_ = std::max(1.0, 0.5 * (high - low).maxCoeff());
  }

  Offset offsetOf(const cv::Point2f& p, const PlacedLines::Point& found) const {
    const Eigen::Vector2d normal(-found.direction.y(), found.direction.x()), x = (vectorOf(p) - middle_) / unit_px_;
    Offset offset;
    offset.by_map << normal, normal.x() * x, normal.y() * x;
    offset.offset_px = normal.dot(found.at - vectorOf(p));
    return offset;
  }

  // Tukey's biweight.
  void fit(const std::vector<Offset>& offsets) {
    const double stays = kStays * static_cast<double>(offsets.size());
    for (int round = 0; round < kRounds; ++round) {
      const double scale_px = round == 0 ? kSought_px : kOff_px;
      Eigen::Matrix<double, 6, 6> H = stays * Eigen::Matrix<double, 6, 6>::Identity();
      Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();
      for (const Offset& one : offsets) {
        const double off = (one.offset_px - one.by_map.dot(map_)) / scale_px;
        if (std::abs(off) >= 1) continue;
        const double weight = (1 - off * off) * (1 - off * off);
        H += weight * one.by_map * one.by_map.transpose();
        g += weight * one.offset_px * one.by_map;
      }
      map_ = H.ldlt().solve(g);
    }
  }

  cv::Point2f operator()(const cv::Point2f& p) const {
    const Eigen::Vector2d x = (vectorOf(p) - middle_) / unit_px_;
    return {static_cast<float>(map_[0] + map_.segment<2>(2).dot(x)),
            static_cast<float>(map_[1] + map_.segment<2>(4).dot(x))};
  }

 private:
  Eigen::Vector2d middle_;
  double unit_px_;
  Eigen::Matrix<double, 6, 1> map_ = Eigen::Matrix<double, 6, 1>::Zero();
};

void bringOnto(const PlacedLines& found, std::vector<Polyline>& lines) {
  AffineMove move(lines);
  std::vector<Offset> offsets;
  for (const Polyline& line : lines) {
    for (std::size_t i = 0; i < line.size(); i += 2) {
      if (const auto* nearest = found.along(line, i, kSought_px)) offsets.push_back(move.offsetOf(line[i], *nearest));
    }
  }
  if (offsets.size() < kFewMatches) return;
  move.fit(offsets);
  const auto tooFar = [&](const cv::Point2f& p) { return !(cv::norm(move(p)) <= kMaxMove_px); };
  for (const Polyline& line : lines) {
    if (std::any_of(line.begin(), line.end(), tooFar)) return;
  }
  for (Polyline& line : lines) {
    for (cv::Point2f& p : line) p += move(p);
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
    if (branch.alive) found.add(branch.line);
  }
  found.place();
  bringOnto(found, lines_);
  for (const Polyline& line : lines_) {
    Polyline missing;
    for (std::size_t i = 0; i <= line.size(); ++i) {
      if (i < line.size() && within_.contains(line[i]) && !found.along(line, i, kFound_px)) {
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
  for (const Polyline& line : lines_) expected.add(line);
  expected.place();
  for (CentreLine& line : lines) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < line.line.size(); ++i) count += expected.along(line.line, i, kFound_px) ? 1 : 0;
    line.expected = static_cast<double>(count) > kMost * static_cast<double>(line.line.size());
  }
}

}  // namespace angio::imaging
