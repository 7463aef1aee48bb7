// SPDX-License-Identifier: GPL-2.0-or-later
#include "lone_catheter.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace angio::perception {
namespace {

// A curve that has this share of the image's points is all that it shows.
constexpr double kOnlyCurve = 0.9;
// Of a line of the background beside the longest: what it absorbs per length, at most, and how far it is, at least.
constexpr double kFaint = 0.5, kAway_px = 15;
// An image with more points in its other lines than so many times those of the longest shows a tree.
constexpr double kMostBackground = 2;

// A branch's points, and the median of what they absorb per length, but for a factor that all share.
struct Line {
  int begin = 0, end = 0;
  double absorbed = 0;

  int size() const { return end - begin; }
};

std::vector<Line> linesOf(const Centerline2d& found) {
  std::vector<Line> lines;
  for (int i = 0; i < found.size(); ++i) {
    if (i == 0 || found.branch[i] != found.branch[i - 1]) lines.push_back({i, i, 0});
    lines.back().end = i + 1;
  }
  for (Line& line : lines) {
    Eigen::VectorXd absorbed =
        found.contrast.segment(line.begin, line.size()).cwiseProduct(found.radius_px.segment(line.begin, line.size()));
    const auto middle = absorbed.begin() + line.size() / 2;
    std::nth_element(absorbed.begin(), middle, absorbed.end());
    line.absorbed = *middle;
  }
  return lines;
}

bool keepsAway(const Line& line, const Line& longest, const Centerline2d& found) {
  const auto others = found.points_px.middleCols(longest.begin, longest.size());
  for (int i = line.begin; i < line.end; ++i) {
    const double squared_px2 = (others.colwise() - found.points_px.col(i)).colwise().squaredNorm().minCoeff();
    if (!(squared_px2 > kAway_px * kAway_px)) return false;
  }
  return true;
}

Centerline2d withoutBackground(const Centerline2d& found) {
  if (!found.ordered() || found.contrast.size() != found.size() || found.radius_px.size() != found.size()) return found;
  const std::vector<Line> lines = linesOf(found);
  const auto longest =
      std::max_element(lines.begin(), lines.end(), [](const Line& a, const Line& b) { return a.size() < b.size(); });
  if (longest == lines.end() || found.size() > (1 + kMostBackground) * longest->size()) return found;
  std::vector<bool> keep(static_cast<std::size_t>(found.size()), true);
  for (const Line& line : lines) {
    const bool background = line.absorbed < kFaint * longest->absorbed && keepsAway(line, *longest, found);
    if (background) std::fill(keep.begin() + line.begin, keep.begin() + line.end, false);
  }
  return pointsWhere(found, keep);
}

}  // namespace

std::optional<LoneCatheter> loneCatheter(const Centerline2d& found, const XrayCamera& camera) {
  Centerline2d curve = withoutBackground(found);
  Centerline2d device = curve;
  device.kind.assign(static_cast<std::size_t>(device.size()), CurveKind::kDevice);
  auto seen = seenCatheter(device, camera);
  if (!seen || static_cast<double>(seen->points_px.cols()) < kOnlyCurve * curve.size()) return std::nullopt;
  return LoneCatheter{std::move(*seen), std::move(curve)};
}

}  // namespace angio::perception
