// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/vessel/centerline2d.hpp"
#include "line_motion.hpp"

namespace angio::imaging {

/// A point of a line that an extractor found [working px].
struct SeenPoint : LinePoint {
  double radius = 0, contrast = 0;
  int line = 0;

  /// What the line absorbs per length, but for a factor that all lines share.
  double absorbed() const { return contrast * radius; }
};

/// The lines that were found in one frame, as the points of its centreline and in their order.
class SeenLines {
 public:
  SeenLines() = default;

  /// @param found  With branches, radii and contrasts [px]. @param px  Pixels of the image in a working pixel.
  SeenLines(const Centerline2d& found, double px);

  const std::vector<SeenPoint>& points() const { return points_; }

  /// The index of the nearest point that runs along; -1 without one within `reach_px` [working px].
  int along(const LinePoint& point, double reach_px) const { return placed_.along(point, reach_px); }

  const PlacedLines& placed() const { return placed_; }

  /// The points [begin, end) of each line.
  struct Range {
    std::size_t begin = 0, end = 0;
  };
  std::vector<Range> lines() const;

  /// Length of a line [working px].
  double length(const Range& line) const;

  /// Median radius of a line [working px].
  double radius(const Range& line) const;

  /// Sum of all lengths by contrasts [working px].
  double amount() const;

  /// How many ends of lines of at least `min_length_px` lie at the side of another line, as a branch's does [working
  /// px].
  int branches(double min_length_px) const;

 private:
  bool isAtSide(std::size_t end) const;

  std::vector<SeenPoint> points_;
  PlacedLines placed_;
};

}  // namespace angio::imaging
