// SPDX-License-Identifier: GPL-2.0-or-later
#include "line_motion.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace angio::imaging {
namespace {

// Lines run along each other at less than 30 degrees (cosine).
constexpr double kAlong = 0.87;
// A line is sought so far from where it is expected [working px].
constexpr double kSought_px = 6;
// Of the affine map: this many places say enough; what lies further off than this says nothing after the first round;
// and no place is moved by more [working px].
constexpr std::size_t kFewMatches = 60;
constexpr double kOff_px = 3, kMaxMove_px = 10;
constexpr int kRounds = 4;
// Weight of a map that moves nothing, over that of the matches.
constexpr double kStays = 1e-3;

// How far a line lies from where it is expected, across it: linear in the six numbers of an affine map.
struct Offset {
  Eigen::Matrix<double, 6, 1> by_map;
  double offset_px;
};

}  // namespace

void PlacedLines::place() {
  Eigen::Matrix2Xd at(2, static_cast<Eigen::Index>(points_.size()));
  for (std::size_t i = 0; i < points_.size(); ++i) at.col(static_cast<Eigen::Index>(i)) = points_[i].at;
  grid_.build(at);
}

int PlacedLines::along(const LinePoint& point, double reach_px) const {
  double best2 = reach_px * reach_px;
  int nearest = -1;
  grid_.eachWithin(point.at, reach_px, [&](int index, double x, double y) {
    if (x * x + y * y > best2 || std::abs((*this)[index].direction.dot(point.direction)) < kAlong) return;
    best2 = x * x + y * y;
    nearest = index;
  });
  return nearest;
}

AffineMove::AffineMove(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9), high = -low;
  for (const Eigen::Vector2d& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  middle_ = 0.5 * (low + high);
  unit_px_ = std::max(1.0, 0.5 * (high - low).maxCoeff());
}

// Tukey's biweight.
void AffineMove::fit(const Matches& matches) {
  std::vector<Offset> offsets;
  for (const auto& [point, found] : matches) {
    const Eigen::Vector2d normal(-found.direction.y(), found.direction.x()), x = (point.at - middle_) / unit_px_;
    Offset& offset = offsets.emplace_back();
    offset.by_map << normal, normal.x() * x, normal.y() * x;
    offset.offset_px = normal.dot(found.at - point.at);
  }
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

AffineMove AffineMove::onto(const PlacedLines& found, const std::vector<LinePoint>& tried,
                            const std::vector<Eigen::Vector2d>& points) {
  Matches matches;
  for (const LinePoint& point : tried) {
    const int nearest = found.along(point, kSought_px);
    if (nearest >= 0) matches.emplace_back(point, found[nearest]);
  }
  if (matches.size() < kFewMatches) return {};
  AffineMove move(points);
  move.fit(matches);
  const auto tooFar = [&](const Eigen::Vector2d& p) { return !(move.by(p).norm() <= kMaxMove_px); };
  return std::any_of(points.begin(), points.end(), tooFar) ? AffineMove() : move;
}

Eigen::Vector2d AffineMove::by(const Eigen::Vector2d& p) const {
  const Eigen::Vector2d x = (p - middle_) / unit_px_;
  return {map_[0] + map_.segment<2>(2).dot(x), map_[1] + map_.segment<2>(4).dot(x)};
}

}  // namespace angio::imaging
