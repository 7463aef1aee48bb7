// SPDX-License-Identifier: GPL-2.0-or-later
#include "explained_raster.hpp"

#include <algorithm>
#include <cmath>

#include "oriented_frame.hpp"

namespace angio::registration {
namespace {

constexpr int kCell_px = 2;
constexpr double kRasterSpacing_px = 2;
constexpr double kSmooth_px = 8, kGap_px = 8;  // A line is fitted so far to both sides, and not over gaps.
constexpr int kMaxImagePoints = 200000;

// Radii in cells of level 0. A level's own cells are a sixth of its radius at most.
constexpr int kRadii[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 56, 64, 80, 96, 128};
static_assert(std::size(kRadii) + 1 == ExplainedRaster::kLevels);

int cellsPerCell(int radius) {
  int cells = 1;
  while (12 * cells <= radius) cells *= 2;
  return cells;
}

// Each of `count` words with those up to `reach` places away, a place being `stride` words; `work` is overwritten.
void widen(std::uint32_t* words, std::ptrdiff_t count, std::ptrdiff_t stride, int reach,
           std::vector<std::uint32_t>& work) {
  work.assign(words, words + count);
  int length = 1;  // work[i] is the union of so many words from i on.
  while (2 * length <= 2 * reach + 1) {
    const std::ptrdiff_t on = length * stride;
    for (std::ptrdiff_t i = 0; i + on < count; ++i) work[i] |= work[i + on];
    length *= 2;
  }
  // Two such stretches cover the reach. Before the first word the stretch begins at the first: it may hold more.
  const std::ptrdiff_t back = reach * stride, other = (length - 1 - reach) * stride;
  const auto from = [&](std::ptrdiff_t i, std::ptrdiff_t by) { return work[i >= by ? i - by : i % stride]; };
  const std::ptrdiff_t edge = std::min(count, std::max(back, other));
  for (std::ptrdiff_t i = 0; i < edge; ++i) words[i] = from(i, back) | from(i, other);
  for (std::ptrdiff_t i = edge; i < count; ++i) {
    words[i] = work[i - back] | work[i - other];
  }
}

int directionBin(double du, double dv) {
  double phi = std::atan2(dv, du);
  if (phi < 0) phi += kPi;
  return static_cast<int>(std::floor(phi * (ExplainedRaster::kDirections / kPi))) & (ExplainedRaster::kDirections - 1);
}

// Direction of the line through a point's neighbours along its branch, which noise turns less than a tangent between
// two of them.
double smoothedDirection(const OrientedPoints& points, int begin, int end, int j) {
  const auto apart = [&](int a, int b) { return std::hypot(points.u[a] - points.u[b], points.v[a] - points.v[b]); };
  const auto reached = [&](int limit, int direction) {
    int at = j;
    for (double along = 0; at != limit; at += direction) {
      const double step = apart(at, at + direction);
      along += step;
      if (along > kSmooth_px || step > kGap_px) break;
    }
    return at;
  };
  const int first = reached(begin, -1), last = reached(end - 1, 1);
  double u = 0, v = 0, uu = 0, uv = 0, vv = 0;
  const int count = last - first + 1;
  for (int i = first; i <= last; ++i) {
    u += points.u[i];
    v += points.v[i];
  }
  u /= count;
  v /= count;
  for (int i = first; i <= last; ++i) {
    const double du = points.u[i] - u, dv = points.v[i] - v;
    uu += du * du;
    uv += du * dv;
    vv += dv * dv;
  }
  if (count < 3 || uu + vv < 1) return 0.5 * std::atan2(points.sin2[j], points.cos2[j]);
  return 0.5 * std::atan2(2 * uv, uu - vv);
}

std::uint32_t directionsNear(double phi) {
  std::uint32_t bits = 0;
  for (int k = 0; k < ExplainedRaster::kDirections; ++k) {
    const double off = std::remainder((k + 0.5) * (kPi / ExplainedRaster::kDirections) - phi, kPi);
    if (std::abs(off) <= ExplainedRaster::kReach_rad) bits |= std::uint32_t{1} << k;
  }
  return bits;
}

}  // namespace

ExplainedRaster::ExplainedRaster(const Centerline2d& image, const XrayCamera& camera) {
  const auto cellsFor = [](int px) { return static_cast<int>(std::ceil((px + 2 * kBefore_px) / kCell_px)) + 1; };
  const int columns = cellsFor(camera.width_px()), rows = cellsFor(camera.height_px());
  std::vector<std::uint32_t> raster(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), 0), work;
  const auto rowOf = [&](int r) { return raster.data() + static_cast<std::ptrdiff_t>(r) * columns; };

  OrientedPoints points;
  orientedPoints(image, kRasterSpacing_px, kMaxImagePoints, points);
  std::size_t branch = 0;
  for (int j = 0; j < points.size(); ++j) {
    while (branch + 1 < points.begin.size() && points.begin[branch + 1] <= j) ++branch;
    const int end = branch + 1 < points.begin.size() ? points.begin[branch + 1] : points.size();
    const double u = points.u[j], v = points.v[j];
    if (!camera.sees({u, v})) continue;  // A file may hold anything.
    const double direction = image.ordered() ? smoothedDirection(points, points.begin[branch], end, j)
                                             : 0.5 * std::atan2(points.sin2[j], points.cos2[j]);
    const std::uint32_t bits = directionsNear(direction);
    const double x = (u + kBefore_px) / kCell_px, y = (v + kBefore_px) / kCell_px, reach = kReach_px / kCell_px;
    for (int r = static_cast<int>(y - reach); r <= static_cast<int>(y + reach); ++r) {
      for (int c = static_cast<int>(x - reach); c <= static_cast<int>(x + reach); ++c) {
        if (std::hypot(c + 0.5 - x, r + 0.5 - y) > reach) continue;
        rowOf(r)[c] |= bits;
      }
    }
  }

  int reached = 0;
  for (int k = 0; k + 1 < kLevels; ++k) {
    const int radius = kRadii[k];
    if (radius > reached) {
      for (int r = 0; r < rows; ++r) widen(rowOf(r), columns, 1, radius - reached, work);
      widen(raster.data(), static_cast<std::ptrdiff_t>(raster.size()), columns, radius - reached, work);
      reached = radius;
    }
    const int cells = cellsPerCell(radius);
    const int first = static_cast<int>(words_.size()), level_columns = (columns + cells - 1) / cells,
              level_rows = (rows + cells - 1) / cells;
    setLevel(k, static_cast<float>(radius * kCell_px), 1.0f / static_cast<float>(cells * kCell_px), level_columns,
             level_rows);
    words_.resize(words_.size() + static_cast<std::size_t>(level_columns) * static_cast<std::size_t>(level_rows), 0);
    for (int r = 0; r < rows; ++r) {
      std::uint32_t* const to = &words_[first + r / cells * level_columns];
      const std::uint32_t* const from = rowOf(r);
      for (int c = 0; c < columns; ++c) to[c / cells] |= from[c];
    }
  }
  std::uint32_t anywhere = 0;
  for (const std::uint32_t word : raster) anywhere |= word;
  setLevel(kLevels - 1, HUGE_VALF, 0, 1, 1);  // One cell for everything.
  words_.push_back(anywhere);
}

void ExplainedRaster::setLevel(int k, float radius_px, float inverse_cell_px, int columns, int rows) {
  levels_.radius_px[k] = radius_px;
  levels_.inverse_cell_px[k] = inverse_cell_px;
  levels_.last_column[k] = static_cast<float>(columns - 1);
  levels_.last_row[k] = static_cast<float>(rows - 1);
  levels_.first[k] = static_cast<std::int32_t>(words_.size());
  levels_.columns[k] = columns;
}

bool ExplainedRaster::explains(double u_px, double v_px, double du, double dv) const {
  // Kept on the raster as numbers: what is next to the source may project anywhere.
  const auto place = [this](double pixel, double last) {
    return static_cast<int>(std::clamp((pixel + kBefore_px) * levels_.inverse_cell_px[0], 0.0, last));
  };
  const int c = place(u_px, levels_.last_column[0]), r = place(v_px, levels_.last_row[0]);
  const std::uint32_t word = words_[r * levels_.columns[0] + c];
  if (du == 0 && dv == 0) return word != 0;
  return ((word >> directionBin(du, dv)) & 1) != 0;
}

}  // namespace angio::registration
