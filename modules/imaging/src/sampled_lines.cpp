// SPDX-License-Identifier: GPL-2.0-or-later
#include "sampled_lines.hpp"

#include <algorithm>
#include <cmath>

namespace angio::imaging {
namespace {

constexpr float kTangentRadii = 0.4f;  // Half of the length that a tangent is taken over.

}  // namespace

Centerline2d sampled(const std::vector<CentreLine>& lines, const WorkingGrid& grid, double spacing_px) {
  const float scale = grid.scale;
  std::vector<std::vector<float>> places;
  Eigen::Index count = 0;
  bool measured = !lines.empty();
  for (const CentreLine& center : lines) {
    places.push_back(equalSteps(center.line, static_cast<float>(spacing_px) / scale));
    count += static_cast<Eigen::Index>(places.back().size());
    measured = measured && !center.sigma.empty();
  }
  Centerline2d result;
  result.points_px.resize(2, count);
  result.tangent_rad.resize(count);
  result.radius_px.resize(count);
  result.branch.reserve(static_cast<std::size_t>(count));
  if (measured) {
    result.std_px.resize(count);
    result.contrast.resize(count);
    result.kind.reserve(static_cast<std::size_t>(count));
  }
  Eigen::Index point = 0;
  for (std::size_t b = 0; b < lines.size(); ++b) {
    const CentreLine& center = lines[b];
    for (const float place : places[b]) {
      const std::size_t i = std::min(static_cast<std::size_t>(place + 0.5f), center.line.size() - 1);
      // A wide vessel's line bends less than its noise does.
      const auto reach = static_cast<std::size_t>(std::max(2.0f, kTangentRadii * center.radius[i]));
      const cv::Point2f p = grid.toImage(at(center.line, place)), along = directionAt(center.line, i, reach);
      result.points_px.col(point) << p.x, p.y;
      result.tangent_rad[point] = undirected(std::atan2(along.y, along.x));
      result.radius_px[point] = scale * center.radius[i];
      result.branch.push_back(static_cast<int>(b));
      if (measured) {
        result.std_px[point] = scale * center.sigma[i];
        result.contrast[point] = center.contrast[i];
        result.kind.push_back(center.kind);
      }
      ++point;
    }
  }
  return result;
}

}  // namespace angio::imaging
