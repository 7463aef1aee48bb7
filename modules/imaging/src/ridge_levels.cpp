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

using FloatTag = hn::CappedTag<float, Plane::kSlack / 2>;
using Float = hn::Vec<FloatTag>;

// Two rows of a level's lines, one above the other or the same, to one of the next finer level. Where there is no line
// all three values are zero.
void doubleRow(const float* const* a, const float* const* b, int width, float* const* to) {
  const FloatTag d;
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
  const FloatTag d;
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
  const FloatTag d;
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

// Where the flanks of a line are looked at, in standard deviations of its scale, and how far the smaller fall from the
// middle must come up to the larger.
constexpr float kFlank = 2.2f, kSymmetry = 0.35f;

// How many standard deviations beside the middle a sharper filter looks.
constexpr float kNarrow = 0.8f, kWide = 1.4f;

// A finer scale's line takes the place of a wide one that it is near to if it is so strong in comparison: two vessels
// that cross or part are not one.
constexpr float kFinerPart = 0.9f;

// The columns of a row's lines; those near a strong finer one are taken out. `near` may be null. Columns 1 to width - 2
// are looked at, and whole vectors of columns are written.
int linesOfRow(float* strength, const float* near, int width, int* columns) {
  const FloatTag d;
  const hn::RebindToSigned<FloatTag> whole;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto zero = hn::Zero(d), part = hn::Set(d, kFinerPart);
  int count = 0;
  for (int i = 1; i < width - 1; i += lanes) {
    const auto inside = hn::RebindMask(d, hn::FirstN(whole, static_cast<std::size_t>(width - 1 - i)));
    const auto value = hn::LoadU(d, strength + i);
    auto line = hn::And(inside, hn::Gt(value, zero));
    if (hn::AllFalse(d, line)) continue;
    if (near != nullptr) {
      const auto finer = hn::And(line, hn::Gt(hn::LoadU(d, near + i), hn::Mul(part, value)));
      hn::StoreU(hn::IfThenZeroElse(finer, value), d, strength + i);
      line = hn::AndNot(finer, line);
    }
    count +=
        static_cast<int>(hn::CompressStore(hn::Iota(whole, i), hn::RebindMask(whole, line), whole, columns + count));
  }
  return count;
}

// Between pixels, bilinear; beyond the image its edge goes on.
Float valuesAt(const FlankPixels& image, Float x, Float y) {
  const FloatTag d;
  const hn::RebindToSigned<FloatTag> whole;
  const auto clamped = [&](Float at, int last) {
    return hn::Min(hn::Max(at, hn::Zero(d)), hn::Set(d, static_cast<float>(last)));
  };
  x = clamped(x, image.width - 1);
  y = clamped(y, image.height - 1);
  const auto x0 = hn::Min(hn::ConvertTo(whole, x), hn::Set(whole, image.width - 2));
  const auto y0 = hn::Min(hn::ConvertTo(whole, y), hn::Set(whole, image.height - 2));
  const auto u = hn::Sub(x, hn::ConvertTo(d, x0)), v = hn::Sub(y, hn::ConvertTo(d, y0));
  const auto place = hn::Add(hn::Mul(y0, hn::Set(whole, image.stride)), x0);
  const auto along = [&](const float* row) {
    const auto left = hn::GatherIndex(d, row, place), right = hn::GatherIndex(d, row + 1, place);
    return hn::MulAdd(u, hn::Sub(right, left), left);
  };
  const auto upper = along(image.values), lower = along(image.values + image.stride);
  return hn::MulAdd(v, hn::Sub(lower, upper), upper);
}

// Takes lines out of a row: those that do not rise on both sides, and those that a sharper filter sees to be darker
// beside their middle. Two vessels side by side are one wide line to a coarse filter.
void scoreRow(const FlankRow& row, const int* columns, int count, float* strength) {
  const FloatTag d;
  const hn::RebindToSigned<FloatTag> whole;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const float *here = row.image.values + static_cast<std::ptrdiff_t>(row.y) * row.image.stride,
              *above = here - row.image.stride, *below = here + row.image.stride;
  const auto zero = hn::Zero(d), half = hn::Set(d, 0.5f), one = hn::Set(d, 1.0f);
  for (int first = 0; first < count; first += lanes) {
    const auto column = hn::LoadU(whole, columns + first);
    const auto at = [&](const float* from, int dx) { return hn::GatherIndex(d, from + dx, column); };
    // Direction across the line, from its doubled angle.
    const auto middle = at(here, 0), twice = hn::Add(middle, middle);
    const auto xx = hn::Sub(hn::Add(at(here, -1), at(here, 1)), twice);
    const auto yy = hn::Sub(hn::Add(at(above, 0), at(below, 0)), twice);
    const auto xy =
        hn::Mul(hn::Set(d, 0.25f), hn::Sub(hn::Add(at(above, -1), at(below, 1)), hn::Add(at(above, 1), at(below, -1))));
    const auto difference = hn::Mul(half, hn::Sub(xx, yy));
    const auto root = hn::Sqrt(hn::MulAdd(difference, difference, hn::Mul(xy, xy)));
    const auto c = hn::Neg(hn::Div(difference, hn::Max(root, hn::Set(d, 1e-30f))));
    const auto nx = hn::Sqrt(hn::Max(zero, hn::Mul(half, hn::Add(one, c))));
    const auto ny = hn::CopySignToAbs(hn::Sqrt(hn::Max(zero, hn::Mul(half, hn::Sub(one, c)))), hn::Neg(xy));
    const auto fx = hn::ConvertTo(d, column), fy = hn::Set(d, static_cast<float>(row.y));
    const auto beside = [&](const FlankPixels& image, float per_pixel, float away) {
      const auto scale = hn::Set(d, per_pixel), far = hn::Set(d, away * row.sigma * per_pixel);
      const auto x = hn::Mul(scale, fx), y = hn::Mul(scale, fy);
      return std::make_pair(valuesAt(image, hn::NegMulAdd(far, nx, x), hn::NegMulAdd(far, ny, y)),
                            valuesAt(image, hn::MulAdd(far, nx, x), hn::MulAdd(far, ny, y)));
    };
    const auto flanks = beside(row.image, 1, kFlank);
    const auto left = hn::Sub(middle, flanks.first), right = hn::Sub(middle, flanks.second);
    const auto allowed = hn::Mul(hn::Set(d, kSymmetry), hn::Max(left, right));
    auto keep = hn::Ge(hn::Min(left, right), allowed);
    if (row.finer.values != nullptr) {
      const auto scale = hn::Set(d, row.per_pixel);
      const auto top = hn::Add(valuesAt(row.finer, hn::Mul(scale, fx), hn::Mul(scale, fy)), allowed);
      for (const float away : {kNarrow, kWide}) {
        const auto sharper = beside(row.finer, row.per_pixel, away);
        keep = hn::AndNot(hn::Gt(hn::Max(sharper.first, sharper.second), top), keep);
      }
    }
    float kept[Plane::kSlack];
    hn::StoreU(hn::IfThenElseZero(keep, one), d, kept);
    for (int k = 0; k < lanes && first + k < count; ++k) {
      if (!(kept[k] > 0)) strength[columns[first + k]] = 0;
    }
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
HWY_EXPORT(linesOfRow);
HWY_EXPORT(scoreRow);

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

FlankPixels pixelsOf(const Plane& plane) {
  return {plane.row(0), static_cast<int>(plane.row(1) - plane.row(0)), plane.width(), plane.height()};
}

}  // namespace

void halveToMax(const cv::Mat& from, cv::Mat& to, std::vector<float>& scratch) {
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

void RidgeFlanks::operator()(const SmoothedImage& image, const FinerImages* finer, Plane& strength) {
  const int width = image.values.width(), height = image.values.height();
  if (width < 3 || height < 3) return;
  columns_.assign(static_cast<std::size_t>(width) + 2 * Plane::kSlack, 1);
  FlankRow row{pixelsOf(image.values), {nullptr, 0, 0, 0}, 1, image.sigma, 0};
  if (finer != nullptr) {
    row.finer = pixelsOf(finer->values);
    row.per_pixel = finer->per_pixel;
  }
  for (row.y = 1; row.y + 1 < height; ++row.y) {
    float* values = strength.row(row.y);
    const float* near = finer != nullptr ? finer->lines.ptr<float>(row.y) : nullptr;
    const int count = HWY_DYNAMIC_DISPATCH(linesOfRow)(values, near, width, columns_.data());
    if (count > 0) HWY_DYNAMIC_DISPATCH(scoreRow)(row, columns_.data(), count, values);
  }
}

}  // namespace angio::imaging
#endif
