// SPDX-License-Identifier: GPL-2.0-or-later
#include "seen_lines.hpp"

#include <cmath>

#include "quantile.hpp"

namespace angio::imaging {
namespace {

// A branch ends this far from the wall of the line that it is a branch of; which goes on to both sides [working px].
constexpr double kJoint_px = 3, kGoesOn_px = 12;

}  // namespace

SeenLines::SeenLines(const Centerline2d& found, double px) {
  for (int i = 0; i < found.size(); ++i) {
    SeenPoint& point = points_.emplace_back();
    point.at = found.points_px.col(i) / px;
    point.direction = {std::cos(found.tangent_rad[i]), std::sin(found.tangent_rad[i])};
    point.radius = found.radius_px[i] / px;
    point.contrast = found.contrast[i];
    point.line = found.branch[i];
    placed_.add(point);
  }
  placed_.place();
}

std::vector<SeenLines::Range> SeenLines::lines() const {
  std::vector<Range> lines;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (i == 0 || points_[i].line != points_[i - 1].line) lines.push_back({i, i});
    lines.back().end = i + 1;
  }
  return lines;
}

double SeenLines::length(const Range& line) const {
  double length = 0;
  for (std::size_t i = line.begin + 1; i < line.end; ++i) length += (points_[i].at - points_[i - 1].at).norm();
  return length;
}

double SeenLines::radius(const Range& line) const {
  std::vector<float> radii;
  for (std::size_t i = line.begin; i < line.end; ++i) radii.push_back(static_cast<float>(points_[i].radius));
  return medianOf(std::move(radii));
}

double SeenLines::amount() const {
  double amount = 0;
  for (std::size_t i = 1; i < points_.size(); ++i) {
    if (points_[i].line != points_[i - 1].line) continue;
    amount += (points_[i].at - points_[i - 1].at).norm() * 0.5 * (points_[i].contrast + points_[i - 1].contrast);
  }
  return amount;
}

bool SeenLines::isAtSide(std::size_t end) const {
  const Eigen::Vector2d at = points_[end].at;
  for (const Range& line : lines()) {
    if (points_[line.begin].line == points_[end].line || (points_[line.begin].at - at).norm() < kGoesOn_px ||
        (points_[line.end - 1].at - at).norm() < kGoesOn_px)
      continue;
    for (std::size_t i = line.begin; i < line.end; ++i) {
      if ((points_[i].at - at).norm() < points_[i].radius + kJoint_px) return true;
    }
  }
  return false;
}

int SeenLines::branches(double min_length_px) const {
  int count = 0;
  for (const Range& line : lines()) {
    if (length(line) < min_length_px) continue;
    count += (isAtSide(line.begin) ? 1 : 0) + (isAtSide(line.end - 1) ? 1 : 0);
  }
  return count;
}

}  // namespace angio::imaging
