// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "angio/geometry/bucket_grid.hpp"
#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// A point of a line with the line's direction there, of length one and undirected [working px].
struct LinePoint {
  Eigen::Vector2d at, direction;
};

/// The points of some lines, to be asked what runs along a place.
class PlacedLines {
 public:
  void add(const LinePoint& point) { points_.push_back(point); }

  /// Call it once, after the last point.
  void place();

  /// The index of the nearest point, in the order of add(), at less than 30 degrees to `point`; -1 without one within
  /// `reach_px`.
  int along(const LinePoint& point, double reach_px) const;

  const LinePoint& operator[](int index) const { return points_[static_cast<std::size_t>(index)]; }

 private:
  std::vector<LinePoint> points_;
  geometry::BucketGrid grid_;
};

/// An affine map that moves lines.
class AffineMove {
 public:
  /// Moves nothing.
  AffineMove() = default;

  /// The map that brings points nearest to found lines, across these and robustly. `tried` are those to go by. Without
  /// enough found lines beside them, or where one of `points` would move by more than 10 working pixels, it moves
  /// nothing.
  static AffineMove onto(const PlacedLines& found, const std::vector<LinePoint>& tried,
                         const std::vector<Eigen::Vector2d>& points);

  /// How far a place moves [working px].
  Eigen::Vector2d by(const Eigen::Vector2d& p) const;

 private:
  using Matches = std::vector<std::pair<LinePoint, LinePoint>>;
  explicit AffineMove(const std::vector<Eigen::Vector2d>& points);
  void fit(const Matches& matches);

  // Places in units of half the extent about the middle, so that all six numbers are pixels at the lines' ends.
  Eigen::Vector2d middle_ = Eigen::Vector2d::Zero();
  double unit_px_ = 1;
  Eigen::Matrix<double, 6, 1> map_ = Eigen::Matrix<double, 6, 1>::Zero();
};

}  // namespace angio::imaging
