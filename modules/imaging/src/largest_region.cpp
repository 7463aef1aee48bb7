// SPDX-License-Identifier: GPL-2.0-or-later
#include "largest_region.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "angio/base/groups.hpp"

namespace angio::imaging {
namespace {

// Joins each pixel with those of the disc about it: three rows of five and, above and below, one pixel.
template <typename Join>
cv::Mat joinedOverDisc(const cv::Mat& mask, const Join& join) {
  const int width = mask.cols, height = mask.rows;
  const auto joined = [&](std::uint8_t a, std::uint8_t b) { return static_cast<std::uint8_t>(join(a, b)); };
  std::vector<std::uint8_t> row(static_cast<std::size_t>(width) + 4);
  cv::Mat fives(mask.size(), CV_8UC1), result(mask.size(), CV_8UC1);
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* const from = mask.ptr(y);
    row[0] = row[1] = from[0];
    std::memcpy(row.data() + 2, from, static_cast<std::size_t>(width));
    row[width + 2] = row[width + 3] = from[width - 1];
    const std::uint8_t* const near = row.data();
    std::uint8_t* const to = fives.ptr(y);
    for (int x = 0; x < width; ++x) {
      to[x] = joined(joined(joined(near[x], near[x + 1]), joined(near[x + 2], near[x + 3])), near[x + 4]);
    }
  }
  for (int y = 0; y < height; ++y) {
    const std::uint8_t *const top = mask.ptr(std::max(0, y - 2)), *const bottom = mask.ptr(std::min(height - 1, y + 2));
    const std::uint8_t *const above = fives.ptr(std::max(0, y - 1)), *const here = fives.ptr(y);
    const std::uint8_t* const below = fives.ptr(std::min(height - 1, y + 1));
    std::uint8_t* const to = result.ptr(y);
    for (int x = 0; x < width; ++x) {
      to[x] = joined(joined(joined(top[x], above[x]), joined(here[x], below[x])), bottom[x]);
    }
  }
  return result;
}

// Pixels of a row that stand together: [begin, end).
struct PixelRun {
  int row, begin, end;
};

std::vector<PixelRun> runsOf(const cv::Mat& mask) {
  std::vector<PixelRun> runs;
  for (int y = 0; y < mask.rows; ++y) {
    const std::uint8_t *const first = mask.ptr(y), *const last = first + mask.cols;
    for (const std::uint8_t* p = first;;) {
      const std::uint8_t* const begin = std::find(p, last, std::uint8_t{255});
      if (begin == last) break;
      p = std::find(begin, last, std::uint8_t{0});
      runs.push_back({y, static_cast<int>(begin - first), static_cast<int>(p - first)});
    }
  }
  return runs;
}

}  // namespace

cv::Mat openedByDisc(const cv::Mat& mask) {
  return joinedOverDisc(joinedOverDisc(mask, std::bit_and<>()), std::bit_or<>());
}

cv::Mat largestRegion(const cv::Mat& mask) {
  const std::vector<PixelRun> runs = runsOf(mask);
  if (runs.empty()) return {};
  Groups regions(runs.size());
  // Of the row above, the first run that may touch the next one.
  std::size_t above = 0;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    while (runs[above].row < runs[i].row - 1 || (runs[above].row < runs[i].row && runs[above].end <= runs[i].begin)) {
      ++above;
    }
    for (std::size_t k = above; runs[k].row < runs[i].row && runs[k].begin < runs[i].end; ++k) {
      regions.join(static_cast<int>(k), static_cast<int>(i));
    }
  }
  std::vector<int> areas(runs.size(), 0);
  for (std::size_t i = 0; i < runs.size(); ++i) areas[regions.of(static_cast<int>(i))] += runs[i].end - runs[i].begin;
  const auto largest = static_cast<int>(std::max_element(areas.begin(), areas.end()) - areas.begin());
  cv::Mat region(mask.size(), CV_8UC1, cv::Scalar(0));
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (regions.of(static_cast<int>(i)) != largest) continue;
    std::fill(region.ptr(runs[i].row) + runs[i].begin, region.ptr(runs[i].row) + runs[i].end, std::uint8_t{255});
  }
  return region;
}

}  // namespace angio::imaging
