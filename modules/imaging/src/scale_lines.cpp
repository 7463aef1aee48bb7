// SPDX-License-Identifier: GPL-2.0-or-later
#include "scale_lines.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

// Compiled once for every vector target by the include below; the best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scale_lines.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

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

constexpr int kBlock = LinePlane::kBlock;

// A row of a LinePlane and its marks, and its lines' columns, in whole vectors of them; returns how many.
int strengthRow(const StrengthRow& of, const RowLines& into, float* to, std::uint8_t* marks) {
  const StrengthRow row = of;  // Of one's own: nothing that is written can be part of it.
  const RowLines found = into;
  const FloatTag d;
  const hn::RebindToSigned<FloatTag> whole;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto half = hn::Set(d, 0.5f), quarter = hn::Set(d, 0.25f), zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const float variance = row.sigma * row.sigma;
  const auto sigma2 = hn::Set(d, variance), per_sigma2 = hn::Set(d, 1 / variance), far = hn::Set(d, row.reach);
  const auto part = hn::Set(d, kFinerPart);
  const auto lane = hn::Iota(whole, 0);  // Made once: it goes by way of memory.
  const auto at = [&](const float* from, int i) { return hn::LoadU(d, from + i); };
  int count = 0, of_block = 0;
  for (int i = 0; i < row.width; i += lanes) {
    std::uint8_t& mark = marks[i / kBlock];
    if (i % kBlock == 0) of_block = count;
    const auto middle = at(row.here, i), left = at(row.here, i - 1), right = at(row.here, i + 1);
    const auto up = at(row.above, i), down = at(row.below, i);
    const auto twice = hn::Add(middle, middle);
    const auto xx = hn::Sub(hn::Add(left, right), twice), yy = hn::Sub(hn::Add(up, down), twice);
    const auto xy = hn::Mul(quarter, hn::Sub(hn::Add(at(row.above, i - 1), at(row.below, i + 1)),
                                             hn::Add(at(row.above, i + 1), at(row.below, i - 1))));
    const auto mean = hn::Mul(half, hn::Add(xx, yy)), difference = hn::Mul(half, hn::Sub(xx, yy));
    const auto root2 = hn::MulAdd(difference, difference, hn::Mul(xy, xy));
    // Most of an image bends too little: that needs no root.
    const auto needed = hn::MulAdd(at(row.least, i), per_sigma2, mean);
    if (hn::AllFalse(d, hn::Or(hn::Lt(needed, zero), hn::Gt(root2, hn::Mul(needed, needed))))) {
      if (mark != 0) hn::StoreU(zero, d, to + i);
    } else {
      const auto root = hn::Sqrt(root2);
      const auto gx = hn::Mul(half, hn::Sub(right, left)), gy = hn::Mul(half, hn::Sub(down, up));
      const auto across = hn::Sub(root, mean);          // Minus the eigenvalue across the line.
      const auto along = hn::Neg(hn::Add(root, mean));  // Minus the one along it.
      // (g . n)^2 = (g^2 + cos 2a (gx^2 - gy^2) + 2 sin 2a gx gy) / 2 with a the direction across.
      const auto inverse = hn::Div(one, hn::Max(root, hn::Set(d, 1e-20f)));
      const auto gx2 = hn::Mul(gx, gx), gy2 = hn::Mul(gy, gy);
      const auto turned = hn::MulAdd(difference, hn::Sub(gx2, gy2), hn::Mul(hn::Add(xy, xy), hn::Mul(gx, gy)));
      const auto slope2 = hn::Mul(half, hn::NegMulAdd(turned, inverse, hn::Add(gx2, gy2)));
      const auto allowed = hn::Mul(far, across);
      const auto strength = hn::Mul(sigma2, hn::NegMulAdd(half, hn::Max(along, zero), across));
      const auto column = hn::Add(lane, hn::Set(whole, i));
      const auto inside = hn::And(hn::Gt(column, hn::Zero(whole)), hn::Lt(column, hn::Set(whole, row.width - 1)));
      auto line = hn::And(hn::Gt(strength, at(row.least, i)), hn::Lt(slope2, hn::Mul(allowed, allowed)));
      line = hn::And(line, hn::RebindMask(d, inside));
      if (row.near != nullptr) line = hn::AndNot(hn::Gt(at(row.near, i), hn::Mul(part, strength)), line);
      hn::StoreU(hn::IfThenElseZero(line, strength), d, to + i);
      // A vector is packed and then stored whole: storing some of its lanes takes hundreds of cycles on some
      // processors.
      const auto packed = hn::RebindMask(whole, line);
      hn::StoreU(hn::Compress(column, packed), whole, found.columns + count);
      hn::StoreU(difference, d, found.row_difference + i);
      hn::StoreU(xy, d, found.row_xy + i);
      count += static_cast<int>(hn::CountTrue(whole, packed));
    }
    if ((i + lanes) % kBlock == 0 || i + lanes >= row.width) mark = count > of_block ? 1 : 0;
  }
  return count;
}

// Between pixels, bilinear; beyond the image its edge goes on.
HWY_INLINE Float valuesAt(const FlankPixels& image, Float x, Float y) {
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
#if HWY_TARGET == HWY_SCALAR
    const auto left = hn::GatherIndex(d, row, place), right = hn::GatherIndex(d, row + 1, place);
#else
    // Two neighbours are gathered as one number of twice the length: gathering takes its time by the number.
    const hn::RepartitionToWide<FloatTag> pair;
    const hn::RebindToSigned<decltype(pair)> wide;
    const auto bytes = hn::ShiftLeft<2>(place);
    const auto pairsAt = [&](const auto& half) {
      return hn::BitCast(d, hn::GatherOffset(pair, reinterpret_cast<const double*>(row), hn::PromoteTo(wide, half)));
    };
    const auto first = pairsAt(hn::LowerHalf(bytes)), last = pairsAt(hn::UpperHalf(hn::Half<decltype(whole)>(), bytes));
    const auto left = hn::ConcatEven(d, last, first), right = hn::ConcatOdd(d, last, first);
#endif
    return hn::MulAdd(u, hn::Sub(right, left), left);
  };
  const auto upper = along(image.values), lower = along(image.values + image.stride);
  return hn::MulAdd(v, hn::Sub(lower, upper), upper);
}

// Takes pixels out of lines: those from which it does not rise on both sides, and those beside whose middle a sharper
// filter sees what is darker. Two vessels side by side are one wide line to a coarse filter. There is room for a vector
// behind the pixels' columns and rows. `strength` has rows of `stride` pixels.
void scorePixels(const FlankImages& by, const LineBends& found, int* rows, int count, float* strength, int stride) {
  const FloatTag d;
  const hn::RebindToSigned<FloatTag> whole;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto zero = hn::Zero(d), half = hn::Set(d, 0.5f), one = hn::Set(d, 1.0f);
  const int* const columns = found.columns;
  for (int k = 0; k < lanes; ++k) rows[count + k] = rows[count - 1];
  for (int first = 0; first < count; first += lanes) {
    const auto column = hn::LoadU(whole, columns + first), row = hn::LoadU(whole, rows + first);
    // Direction across the line, from its doubled angle.
    const auto middle = hn::LoadU(d, found.middle + first), difference = hn::LoadU(d, found.difference + first);
    const auto xy = hn::LoadU(d, found.xy + first);
    const auto root = hn::Sqrt(hn::MulAdd(difference, difference, hn::Mul(xy, xy)));
    const auto c = hn::Neg(hn::Div(difference, hn::Max(root, hn::Set(d, 1e-30f))));
    const auto nx = hn::Sqrt(hn::Max(zero, hn::Mul(half, hn::Add(one, c))));
    const auto ny = hn::CopySignToAbs(hn::Sqrt(hn::Max(zero, hn::Mul(half, hn::Sub(one, c)))), hn::Neg(xy));
    const auto fx = hn::ConvertTo(d, column), fy = hn::ConvertTo(d, row);
    const auto beside = [&](const FlankPixels& image, float per_pixel, float away) {
      const auto scale = hn::Set(d, per_pixel), far = hn::Set(d, away * by.sigma * per_pixel);
      const auto x = hn::Mul(scale, fx), y = hn::Mul(scale, fy);
      return std::make_pair(valuesAt(image, hn::NegMulAdd(far, nx, x), hn::NegMulAdd(far, ny, y)),
                            valuesAt(image, hn::MulAdd(far, nx, x), hn::MulAdd(far, ny, y)));
    };
    const auto flanks = beside(by.image, 1, kFlank);
    const auto left = hn::Sub(middle, flanks.first), right = hn::Sub(middle, flanks.second);
    const auto allowed = hn::Mul(hn::Set(d, kSymmetry), hn::Max(left, right));
    auto keep = hn::Ge(hn::Min(left, right), allowed);
    if (by.finer.values != nullptr && !hn::AllFalse(d, keep)) {
      const auto scale = hn::Set(d, by.per_pixel);
      const auto top = hn::Add(valuesAt(by.finer, hn::Mul(scale, fx), hn::Mul(scale, fy)), allowed);
      for (const float away : {kNarrow, kWide}) {
        const auto sharper = beside(by.finer, by.per_pixel, away);
        keep = hn::AndNot(hn::Gt(hn::Max(sharper.first, sharper.second), top), keep);
      }
    }
    float kept[Plane::kSlack];
    hn::StoreU(hn::IfThenElseZero(keep, one), d, kept);
    for (int k = first; k < std::min(first + lanes, count); ++k) {
      if (!(kept[k - first] > 0)) strength[static_cast<std::ptrdiff_t>(rows[k]) * stride + columns[k]] = 0;
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::imaging
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::imaging {
namespace {

HWY_EXPORT(strengthRow);
HWY_EXPORT(scorePixels);

// So many pixels of lines are scored at a time, and those of the row that brings as many.
constexpr int kGathered = 96;

FlankPixels pixelsOf(const Plane& plane) {
  return {plane.row(0), static_cast<int>(plane.row(1) - plane.row(0)), plane.width(), plane.height()};
}

}  // namespace

// Rows are asked while they are at hand, their lines by whole vectors of pixels.
void ScaleLineFinder::operator()(const SmoothedImage& image, float reach, const cv::Mat& least,
                                 const FinerImages* finer, LinePlane& strength) {
  const Plane& values = image.values;
  const int width = values.width(), height = values.height();
  strength.resize(width, height);
  if (height < 3) return;
  const std::size_t most = static_cast<std::size_t>(kGathered) + static_cast<std::size_t>(width) + 2 * Plane::kSlack;
  for (auto* places : {&columns_, &rows_}) places->assign(most, 1);
  for (auto* bends : {&middle_, &difference_, &xy_, &row_difference_, &row_xy_}) bends->resize(most);
  threshold_.resize(static_cast<std::size_t>(width) + Plane::kSlack);
  FlankImages flanks{pixelsOf(values), {nullptr, 0, 0, 0}, 1, image.sigma};
  if (finer != nullptr) {
    flanks.finer = pixelsOf(finer->values);
    flanks.per_pixel = finer->per_pixel;
  }
  const int stride = static_cast<int>(strength.row(1) - strength.row(0));
  int block = -1, count = 0;
  for (int y = 1; y + 1 < height; ++y) {
    if (y * least.rows / height != block) {
      block = y * least.rows / height;
      for (int x = 0; x < width; ++x) threshold_[x] = least.at<float>(block, x * least.cols / width);
    }
    const float* near = finer != nullptr ? finer->lines.row(y) : nullptr;
    const StrengthRow row{values.row(y - 1), values.row(y), values.row(y + 1), threshold_.data(), near, width,
                          image.sigma,       reach};
    const RowLines found{columns_.data() + count, row_difference_.data(), row_xy_.data()};
    const int of_row = HWY_DYNAMIC_DISPATCH(strengthRow)(row, found, strength.row(y), strength.marks(y));
    for (const int end = count + of_row; count < end; ++count) {
      const int x = columns_[count];
      rows_[count] = y;
      middle_[count] = row.here[x];
      difference_[count] = row_difference_[x];
      xy_[count] = row_xy_[x];
    }
    if (count < kGathered && (y + 2 < height || count == 0)) continue;
    const LineBends all{columns_.data(), middle_.data(), difference_.data(), xy_.data()};
    HWY_DYNAMIC_DISPATCH(scorePixels)(flanks, all, rows_.data(), count, strength.row(0), stride);
    count = 0;
  }
}

}  // namespace angio::imaging
#endif
