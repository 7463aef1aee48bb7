// SPDX-License-Identifier: GPL-2.0-or-later
#include "ridge_flanks.hpp"

#include <cstdint>

// Compiled once for every vector target by the include below; the best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ridge_flanks.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef ANGIO_RIDGE_FLANKS_SHARED
#define ANGIO_RIDGE_FLANKS_SHARED
namespace angio::imaging {

// The pixels of a plane.
struct FlankPixels {
  const float* values;
  int stride, width, height;
};

// What a row of lines is judged by. `finer.values` is null where no finer image is asked.
struct FlankRow {
  FlankPixels image, finer;
  float per_pixel, sigma;
  int y;
};

}  // namespace angio::imaging
#endif

HWY_BEFORE_NAMESPACE();
namespace angio::imaging {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::CappedTag<float, Plane::kSlack / 2>;
using Float = hn::Vec<FloatTag>;

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
void judgeRow(const FlankRow& row, const int* columns, int count, float* strength) {
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

HWY_EXPORT(linesOfRow);
HWY_EXPORT(judgeRow);

FlankPixels pixelsOf(const Plane& plane) {
  return {plane.row(0), static_cast<int>(plane.row(1) - plane.row(0)), plane.width(), plane.height()};
}

}  // namespace

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
    if (count > 0) HWY_DYNAMIC_DISPATCH(judgeRow)(row, columns_.data(), count, values);
  }
}

}  // namespace angio::imaging
#endif
