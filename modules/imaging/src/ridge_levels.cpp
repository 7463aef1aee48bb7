// SPDX-License-Identifier: GPL-2.0-or-later
#include "ridge_levels.hpp"

#include <hwy/cache_control.h>
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

constexpr int kBlock = LinePlane::kBlock;

// What lies on a block of coarser pixels: these where they lie, else between. The last odd pixel's right neighbour is
// its left one.
void doubleBlock(const CoarserRows& coarser, int first, int width, float* const* to) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto half = hn::Set(d, 0.5f);
  for (int plane = 0; plane < 3; ++plane) {
    const float *upper = coarser.upper[plane], *lower = coarser.lower[plane];
    const auto meanAt = [&](int i) { return hn::Mul(half, hn::Add(hn::LoadU(d, upper + i), hn::LoadU(d, lower + i))); };
    for (int i = first; i < first + kBlock; i += lanes) {
      const auto here = meanAt(i);
      hn::StoreInterleaved2(here, hn::Mul(half, hn::Add(here, meanAt(i + 1))), d, to[plane] + 2 * i);
    }
    if (width % 2 == 0 && coarser.last < first + kBlock) {
      to[plane][width - 1] = 0.5f * (upper[coarser.last] + lower[coarser.last]);
    }
  }
}

// A block of the strongest lines: what is there from the coarser level, or nothing, and what of the own scales is
// stronger.
void takeBlock(const ScaleRow* own, int count, bool has_coarser, int block, const StrongestRow& best) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  bool any = false;
  for (int i = block * kBlock; i < (block + 1) * kBlock; i += lanes) {
    const auto before = [&](int plane) { return has_coarser ? hn::LoadU(d, best.values[plane] + i) : hn::Zero(d); };
    auto strength = before(0), radius = before(1), salience = before(2);
    for (int k = 0; k < count; ++k) {
      if (own[k].marks[block] == 0) continue;
      const auto here = hn::LoadU(d, own[k].strength + i);
      const auto stronger = hn::Gt(here, strength);
      radius = hn::IfThenElse(stronger, hn::Set(d, own[k].radius), radius);
      salience = hn::IfThenElse(stronger, hn::Mul(here, hn::LoadU(d, own[k].per_noise + i)), salience);
      strength = hn::IfThenElse(stronger, here, strength);
    }
    hn::StoreU(strength, d, best.values[0] + i);
    hn::StoreU(radius, d, best.values[1] + i);
    hn::StoreU(salience, d, best.values[2] + i);
    any = any || !hn::AllFalse(d, hn::Gt(strength, hn::Zero(d)));
  }
  best.marks[block] = any ? 1 : 0;
}

// Marked blocks are too far apart for the processor to foresee which is next, and take long to come.
constexpr int kAhead = 8;

void prefetchBlocks(const ScaleRow& own, int block, int width) {
  for (int b = block; b < block + 2 && b * kBlock < width; ++b) {
    if (own.marks[b] != 0) hwy::Prefetch(own.strength + b * kBlock);
  }
}

// A row of StrongestLines; `coarser` may be null.
void strongestRow(const CoarserRows* coarser, const ScaleRow* own, int count, int width, const StrongestRow& best) {
  for (int first = 0; 2 * first < width; first += kBlock) {
    bool has_coarser = false;
    if (coarser != nullptr) {
      const std::uint8_t *upper = coarser->upper_marks + first / kBlock, *lower = coarser->lower_marks + first / kBlock;
      has_coarser = (upper[0] | upper[1] | lower[0] | lower[1]) != 0;
      if (has_coarser) doubleBlock(*coarser, first, width, best.values);
    }
    for (int k = 0; k < count; ++k) prefetchBlocks(own[k], 2 * first / kBlock + kAhead, width);
    for (int block = 2 * first / kBlock; block < 2 * first / kBlock + 2 && block * kBlock < width; ++block) {
      bool has_own = false;
      for (int k = 0; k < count; ++k) has_own = has_own || own[k].marks[block] != 0;
      if (has_coarser || has_own || best.marks[block] != 0) takeBlock(own, count, has_coarser, block, best);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::imaging
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::imaging {
namespace {

HWY_EXPORT(strongestRow);

CoarserRows rowsOf(const StrongestLines& coarser, int y) {
  const int upper = y / 2, lower = std::min((y + 1) / 2, coarser.strength.height() - 1);
  const LinePlane &strength = coarser.strength, &radius = coarser.radius, &salience = coarser.salience;
  return {{strength.row(upper), radius.row(upper), salience.row(upper)},
          {strength.row(lower), radius.row(lower), salience.row(lower)},
          strength.marks(upper),
          strength.marks(lower),
          strength.width() - 1};
}

// One over the noise of a scale at each pixel of a row, block by block of the image.
class InverseNoise {
 public:
  const float* row(const cv::Mat& noise, int y, int width, int height) {
    const int block = y * noise.rows / height;
    if (block == block_) return values_.data();
    block_ = block;
    values_.resize(static_cast<std::size_t>(width) + Plane::kSlack);
    for (int x = 0; x < width; ++x) {
      values_[x] = 1 / std::max(noise.at<float>(block, x * noise.cols / width), 1e-6f);
    }
    return values_.data();
  }

 private:
  int block_ = -1;
  std::vector<float> values_;
};

}  // namespace

void takeStronger(const StrongestLines* coarser, const std::vector<ScaleLines>& scales, StrongestLines& best) {
  const int width = scales.front().strength.width(), height = scales.front().strength.height();
  for (LinePlane* plane : {&best.strength, &best.radius, &best.salience}) plane->resize(width, height);
  std::vector<InverseNoise> noises(scales.size());
  std::vector<ScaleRow> own(scales.size());
  for (int y = 0; y < height; ++y) {
    for (std::size_t k = 0; k < scales.size(); ++k) {
      const ScaleLines& scale = scales[k];
      own[k] = {scale.strength.row(y), noises[k].row(scale.noise, y, width, height), scale.strength.marks(y),
                scale.radius};
    }
    const StrongestRow row{{best.strength.row(y), best.radius.row(y), best.salience.row(y)}, best.strength.marks(y)};
    const CoarserRows rows = coarser != nullptr ? rowsOf(*coarser, y) : CoarserRows{};
    HWY_DYNAMIC_DISPATCH(strongestRow)
    (coarser != nullptr ? &rows : nullptr, own.data(), static_cast<int>(own.size()), width, row);
  }
}

}  // namespace angio::imaging
#endif
