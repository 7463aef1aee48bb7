// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "centre_lines.hpp"
#include "field_outline.hpp"
#include "line_density.hpp"
#include "quantile.hpp"

namespace angio::imaging {

/// Whether a point is so near to the border of the open part, a range for each row, that a line which ends there comes
/// in from outside.
inline bool atBorder(const cv::Point2f& p, const std::vector<RowRange>& open) {
  constexpr float kAtBorder = 9;  // [working px]
  const int y = std::clamp(static_cast<int>(p.y + 0.5f), 0, static_cast<int>(open.size()) - 1);
  const auto lit = [&](int row) {
    return row >= 0 && row < static_cast<int>(open.size()) && open[row].begin < open[row].end &&
           p.x >= static_cast<float>(open[row].begin) && p.x < static_cast<float>(open[row].end);
  };
  const int reach = static_cast<int>(kAtBorder);
  return p.x - static_cast<float>(open[y].begin) < kAtBorder || static_cast<float>(open[y].end) - p.x < kAtBorder ||
         !lit(y - reach) || !lit(y + reach);
}

/// The median of values [from, to).
inline float medianWithin(const std::vector<float>& values, std::size_t from, std::size_t to) {
  return medianOf(std::vector<float>(values.begin() + static_cast<std::ptrdiff_t>(from),
                                     values.begin() + static_cast<std::ptrdiff_t>(to)));
}

/// A line's middling values.
struct LineProfile {
  float radius = 0, contrast = 0, density = 0;
  std::size_t length = 0;
};

/// Of its first `count` points.
inline LineProfile profileOf(const CentreLine& line, std::size_t count) {
  return {medianWithin(line.radius, 0, count), medianWithin(line.contrast, 0, count),
          medianOf(densitiesAlong(line, count)), count};
}

/// Median density, by length, of the profiles that take part; 0 when they bring less than `length`.
template <typename TakesPart>
float densityOf(const std::vector<LineProfile>& profiles, std::size_t length, const TakesPart& takes_part) {
  std::vector<std::pair<float, std::size_t>> others;
  std::size_t total = 0;
  for (std::size_t l = 0; l < profiles.size(); ++l) {
    if (!takes_part(l)) continue;
    others.emplace_back(profiles[l].density, profiles[l].length);
    total += profiles[l].length;
  }
  if (total < std::max<std::size_t>(1, length)) return 0;
  std::sort(others.begin(), others.end());
  std::size_t passed = 0;
  for (const auto& [density, own] : others) {
    passed += own;
    if (2 * passed >= total) return density;
  }
  return 0;
}

}  // namespace angio::imaging
