// SPDX-License-Identifier: GPL-2.0-or-later
#include "line_kinds.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

namespace angio::imaging {
namespace {

// A line begins at the border when its end is so near to it [working px].
constexpr float kAtBorder = 9;

// Edges and overlaps of bones and organs absorb less than this; a line that absorbs more is a vessel, however dilute.
constexpr float kBone = 0.15f;

// A line that stands alone must have this many times the density that the others must.
constexpr float kAloneFactor = 1.37f;

// An end so near to another line [working px] is a branch's.
constexpr float kHeld = 2;

// The image resolves no radius below this one [working px]: blur takes what is missing from the contrast.
constexpr float kThinnest = 0.5f;

// Whether an end of a line is at another one.
bool isBranch(const CentreLine& line, const std::vector<CentreLine>& lines, const std::vector<cv::Rect2f>& around) {
  const auto touches = [&](const cv::Point2f& end) {
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (&lines[i] == &line || !around[i].contains(end)) continue;
      const auto near = [&](const cv::Point2f& p) { return cv::norm(p - end) < kHeld; };
      if (std::any_of(lines[i].line.begin(), lines[i].line.end(), near)) return true;
    }
    return false;
  };
  return touches(line.line.front()) || touches(line.line.back());
}

// Where something that touches a line can be.
cv::Rect2f around(const CentreLine& line) {
  cv::Point2f least = line.line.front(), most = least;
  for (const cv::Point2f& p : line.line) {
    least = {std::min(least.x, p.x), std::min(least.y, p.y)};
    most = {std::max(most.x, p.x), std::max(most.y, p.y)};
  }
  const cv::Point2f margin(kHeld, kHeld);
  return {least - margin, most + margin};
}

}  // namespace

bool atBorder(const cv::Point2f& p, const std::vector<RowRange>& open) {
  const int y = std::clamp(static_cast<int>(p.y + 0.5f), 0, static_cast<int>(open.size()) - 1);
  const auto lit = [&](int row) {
    return row >= 0 && row < static_cast<int>(open.size()) && open[row].begin < open[row].end &&
           p.x >= static_cast<float>(open[row].begin) && p.x < static_cast<float>(open[row].end);
  };
  const int reach = static_cast<int>(kAtBorder);
  return p.x - static_cast<float>(open[y].begin) < kAtBorder || static_cast<float>(open[y].end) - p.x < kAtBorder ||
         !lit(y - reach) || !lit(y + reach);
}

float medianOf(std::vector<float> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<float> densitiesOf(const CentreLine& line, std::size_t count) {
  std::vector<float> densities(count);
  for (std::size_t i = 0; i < count; ++i) densities[i] = line.contrast[i] / std::max(line.radius[i], kThinnest);
  return densities;
}

void dropAlongBorder(std::vector<CentreLine>& lines, const std::vector<RowRange>& open) {
  const auto follows = [&](const CentreLine& line) {
    const auto near =
        std::count_if(line.line.begin(), line.line.end(), [&](const auto& p) { return atBorder(p, open); });
    return 2 * static_cast<std::size_t>(near) > line.line.size();
  };
  lines.erase(std::remove_if(lines.begin(), lines.end(), follows), lines.end());
}

void dropDilute(std::vector<CentreLine>& lines, float least) {
  std::vector<float> of_vessels;
  for (const CentreLine& line : lines) {
    if (line.kind == CurveKind::kDevice) continue;
    const std::vector<float> own = densitiesOf(line, line.line.size());
    of_vessels.insert(of_vessels.end(), own.begin(), own.end());
  }
  if (of_vessels.empty()) return;
  const float usual = medianOf(std::move(of_vessels));
  std::vector<cv::Rect2f> places;
  for (const CentreLine& line : lines) places.push_back(around(line));
  const auto dilute = [&](const CentreLine& line) {
    if (medianOf(line.contrast) >= kBone) return false;
    const float density = medianOf(densitiesOf(line, line.line.size()));
    return density < least * usual || (density < kAloneFactor * least * usual && !isBranch(line, lines, places));
  };
  std::vector<CentreLine> kept;
  for (CentreLine& line : lines) {
    if (!dilute(line)) kept.push_back(line);
  }
  lines = std::move(kept);
}

}  // namespace angio::imaging
