// SPDX-License-Identifier: GPL-2.0-or-later
#include "ridge_levels.hpp"

#include <algorithm>

// Compiled once for every vector target by the include below; the best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ridge_levels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace angio::imaging {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Two rows of a level's lines, one above the other or the same, to one of the next finer level. Where there is no line
// all three values are zero.
void doubleRow(const float* const* a, const float* const* b, int width, float* const* to) {
  const hn::CappedTag<float, Plane::kSlack / 2> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto half = hn::Set(d, 0.5f), zero = hn::Zero(d);
  for (int i = 0; 2 * i < width; i += lanes) {
    const auto sumAt = [&](int plane, int k) {
      return hn::Add(hn::LoadU(d, a[plane] + k), hn::LoadU(d, b[plane] + k));
    };
    const bool none = hn::AllTrue(d, hn::Eq(hn::Add(sumAt(0, i), sumAt(0, i + 1)), zero));
    for (int plane = 0; plane < 3; ++plane) {
      if (none) {
        hn::StoreU(zero, d, to[plane] + 2 * i);
        hn::StoreU(zero, d, to[plane] + 2 * i + lanes);
        continue;
      }
      const auto here = hn::Mul(half, sumAt(plane, i)), next = hn::Mul(half, sumAt(plane, i + 1));
      hn::StoreInterleaved2(here, hn::Mul(half, hn::Add(here, next)), d, to[plane] + 2 * i);
    }
  }
}

// Largest of three neighbours at every other pixel of a row; `from` has a pixel before it, and slack behind.
void poolRow(const float* from, int count, float* to) {
  const hn::CappedTag<float, Plane::kSlack / 2> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < count; i += lanes) {
    hn::Vec<decltype(d)> before, even, odd, unused;
    hn::LoadInterleaved2(d, from + 2 * i, even, odd);
    hn::LoadInterleaved2(d, from + 2 * i - 1, before, unused);
    hn::StoreU(hn::Max(before, hn::Max(even, odd)), d, to + i);
  }
}

// Takes what is stronger into the rows of StrongestLines.
void strongerRow(const float* strength, const float* per_noise, float radius, int width, float* const* best) {
  const hn::CappedTag<float, Plane::kSlack / 2> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto wide = hn::Set(d, radius);
  for (int i = 0; i < width; i += lanes) {
    const auto here = hn::LoadU(d, strength + i), before = hn::LoadU(d, best[0] + i);
    const auto stronger = hn::Gt(here, before);
    if (hn::AllFalse(d, stronger)) continue;
    hn::StoreU(hn::IfThenElse(stronger, here, before), d, best[0] + i);
    hn::StoreU(hn::IfThenElse(stronger, wide, hn::LoadU(d, best[1] + i)), d, best[1] + i);
    const auto salience = hn::Mul(here, hn::LoadU(d, per_noise + i));
    hn::StoreU(hn::IfThenElse(stronger, salience, hn::LoadU(d, best[2] + i)), d, best[2] + i);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::imaging
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::imaging {
namespace {

HWY_EXPORT(doubleRow);
HWY_EXPORT(poolRow);
HWY_EXPORT(strongerRow);

// A row of a level from the next coarser one.
void doubledRow(const StrongestLines& coarse, int y, int width, float* const* to) {
  const Plane* from[] = {&coarse.strength, &coarse.radius, &coarse.salience};
  const int upper = y / 2, lower = std::min((y + 1) / 2, coarse.strength.height() - 1);
  const float* a[] = {from[0]->row(upper), from[1]->row(upper), from[2]->row(upper)};
  const float* b[] = {from[0]->row(lower), from[1]->row(lower), from[2]->row(lower)};
  HWY_DYNAMIC_DISPATCH(doubleRow)(a, b, width, to);
  // Rows have room past their ends; the last odd pixel's right neighbour is its left one.
  const int last = coarse.strength.width() - 1;
  for (int plane = 0; plane < 3 && width % 2 == 0; ++plane) {
    to[plane][width - 1] = 0.5f * (a[plane][last] + b[plane][last]);
  }
}

}  // namespace

void halveToLargest(const cv::Mat& from, cv::Mat& to, std::vector<float>& scratch) {
  const int cols = from.cols, half = (cols + 1) / 2;
  scratch.resize(static_cast<std::size_t>(cols) + half + 3 * Plane::kSlack);
  float *tallest = scratch.data() + 1, *pooled = tallest + cols + Plane::kSlack;
  to.create((from.rows + 1) / 2, half, CV_32F);
  for (int y = 0; y < to.rows; ++y) {
    const float *above = from.ptr<float>(std::max(0, 2 * y - 1)), *here = from.ptr<float>(2 * y);
    const float* below = from.ptr<float>(std::min(from.rows - 1, 2 * y + 1));
    for (int x = 0; x < cols; ++x) tallest[x] = std::max(here[x], std::max(above[x], below[x]));
    tallest[-1] = tallest[0];
    tallest[cols] = tallest[cols - 1];
    HWY_DYNAMIC_DISPATCH(poolRow)(tallest, half, pooled);
    std::copy_n(pooled, half, to.ptr<float>(y));
  }
}

// Row after row, so that each is still at hand for the next scale.
void takeStronger(const StrongestLines* coarser, const std::vector<ScaleLines>& scales, const StrongestLines& best) {
  const int width = best.strength.width(), height = best.strength.height();
  const std::size_t stride = static_cast<std::size_t>(width) + Plane::kSlack;
  std::vector<float> per_noise(scales.size() * stride);
  std::vector<int> blocks(scales.size(), -1);
  for (int y = 0; y < height; ++y) {
    float* rows[] = {best.strength.row(y), best.radius.row(y), best.salience.row(y)};
    if (coarser != nullptr) {
      doubledRow(*coarser, y, width, rows);
    } else {
      for (float* row : rows) std::fill(row, row + width, 0.0f);
    }
    for (std::size_t k = 0; k < scales.size(); ++k) {
      const cv::Mat& noise = scales[k].noise;
      float* inverse = per_noise.data() + k * stride;
      const int block = y * noise.rows / height;
      if (block != blocks[k]) {
        blocks[k] = block;
        for (int x = 0; x < width; ++x) {
          inverse[x] = 1 / std::max(noise.at<float>(block, x * noise.cols / width), 1e-6f);
        }
      }
      HWY_DYNAMIC_DISPATCH(strongerRow)(scales[k].strength.row(y), inverse, scales[k].radius, width, rows);
    }
  }
}

}  // namespace angio::imaging
#endif
