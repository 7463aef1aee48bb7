// SPDX-License-Identifier: GPL-2.0-or-later
#include "finer_lines.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

// Compiled once for every vector target by the include below; the best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "finer_lines.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace angio::imaging {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::CappedTag<float, Plane::kSlack / 2>;

// The largest of some rows.
void largestOfRows(const float* const* rows, int count, int width, float* to) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < width; i += lanes) {
    auto largest = hn::LoadU(d, rows[0] + i);
    for (int k = 1; k < count; ++k) largest = hn::Max(largest, hn::LoadU(d, rows[k] + i));
    hn::StoreU(largest, d, to + i);
  }
}

// The same of three rows of lines.
void largestOfLines(const float* const* rows, const std::uint8_t* const* marks, int width, float* to) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < width; i += lanes) {
    const int block = i / LinePlane::kBlock;
    if ((marks[0][block] | marks[1][block] | marks[2][block]) == 0) {
      hn::StoreU(hn::Zero(d), d, to + i);
    } else {
      const auto outer = hn::Max(hn::LoadU(d, rows[0] + i), hn::LoadU(d, rows[2] + i));
      hn::StoreU(hn::Max(hn::LoadU(d, rows[1] + i), outer), d, to + i);
    }
  }
}

// The largest of each pixel and its `reach` neighbours to both sides, which can be read.
void largestAlong(const float* from, int reach, int width, float* to) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < width; i += lanes) {
    auto largest = hn::LoadU(d, from + i);
    for (int k = 1; k <= reach; ++k) {
      largest = hn::Max(largest, hn::Max(hn::LoadU(d, from + i - k), hn::LoadU(d, from + i + k)));
    }
    hn::StoreU(largest, d, to + i);
  }
}

// Largest of three neighbours at every other pixel of a row; `from` has a pixel before it, and slack behind.
void poolRow(const float* from, int count, float* to) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < count; i += lanes) {
    hn::Vec<decltype(d)> before, even, odd, unused;
    hn::LoadInterleaved2(d, from + 2 * i, even, odd);
    hn::LoadInterleaved2(d, from + 2 * i - 1, before, unused);
    hn::StoreU(hn::Max(before, hn::Max(even, odd)), d, to + i);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::imaging
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::imaging {
namespace {

HWY_EXPORT(largestOfRows);
HWY_EXPORT(largestAlong);
HWY_EXPORT(poolRow);
HWY_EXPORT(largestOfLines);

// The three rows that a row of half the size looks at.
std::array<int, 3> rowsOf(int y, int height) {
  return {std::max(0, 2 * y - 1), 2 * y, std::min(height - 1, 2 * y + 1)};
}

}  // namespace

template <typename LargestOfRows>
void LargestNear::halve(int width, int height, const LargestOfRows& largestOf, Plane& to) {
  const int half = (width + 1) / 2;
  tallest_.resize(static_cast<std::size_t>(width) + 3 * Plane::kSlack);
  float* tallest = tallest_.data() + 1;
  to.resize(half, (height + 1) / 2);
  for (int y = 0; y < to.height(); ++y) {
    largestOf(rowsOf(y, height), tallest);
    tallest[-1] = tallest[0];
    tallest[width] = tallest[width - 1];
    HWY_DYNAMIC_DISPATCH(poolRow)(tallest, half, to.row(y));
  }
}

void LargestNear::halve(const Plane& from, Plane& to) {
  const auto largestOf = [&](const std::array<int, 3>& y, float* largest) {
    const float* rows[] = {from.row(y[0]), from.row(y[1]), from.row(y[2])};
    HWY_DYNAMIC_DISPATCH(largestOfRows)(rows, 3, from.width(), largest);
  };
  halve(from.width(), from.height(), largestOf, to);
}

void LargestNear::halve(const LinePlane& from, Plane& to) {
  const auto largestOf = [&](const std::array<int, 3>& y, float* largest) {
    const float* rows[] = {from.row(y[0]), from.row(y[1]), from.row(y[2])};
    const std::uint8_t* marks[] = {from.marks(y[0]), from.marks(y[1]), from.marks(y[2])};
    HWY_DYNAMIC_DISPATCH(largestOfLines)(rows, marks, from.width(), largest);
  };
  halve(from.width(), from.height(), largestOf, to);
}

void LargestNear::spread(const Plane& from, int reach, Plane& to) {
  const int width = from.width(), height = from.height();
  tallest_.resize(static_cast<std::size_t>(width) + 2 * reach + 2 * Plane::kSlack);
  float *before = tallest_.data(), *tallest = before + reach;
  to.resize(width, height);
  for (int y = 0; y < height; ++y) {
    rows_.clear();
    for (int k = std::max(0, y - reach); k <= std::min(height - 1, y + reach); ++k) rows_.push_back(from.row(k));
    HWY_DYNAMIC_DISPATCH(largestOfRows)(rows_.data(), static_cast<int>(rows_.size()), width, tallest);
    // What repeats an edge is not larger than it.
    std::fill(before, tallest, tallest[0]);
    std::fill(tallest + width, tallest + width + reach, tallest[width - 1]);
    HWY_DYNAMIC_DISPATCH(largestAlong)(tallest, reach, width, to.row(y));
  }
}

void takeLarger(const Plane& other, Plane& to) {
  for (int y = 0; y < to.height(); ++y) {
    const float* rows[] = {to.row(y), other.row(y)};
    HWY_DYNAMIC_DISPATCH(largestOfRows)(rows, 2, to.width(), to.row(y));
  }
}

}  // namespace angio::imaging
#endif
