// SPDX-License-Identifier: GPL-2.0-or-later
#include "quantile.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>

// Compiled once for every vector target by the include below; the best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "quantile.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace angio::imaging {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kMaxLanes = 16;
using Keys = hn::CappedTag<std::int32_t, kMaxLanes>;
using Key = hn::Vec<Keys>;

// The bits of floats in the order of whole numbers: those of negative ones run the other way.
HWY_INLINE Key keysOf(const float* values) {
  const Keys d;
  const hn::RebindToFloat<Keys> f;
  const auto bits = hn::BitCast(d, hn::LoadU(f, values));
  return hn::Xor(bits, hn::And(hn::ShiftRight<31>(bits), hn::Set(d, std::numeric_limits<std::int32_t>::max())));
}

// The value is found bit by bit, from the highest on, by counting what lies below: no value is moved, and no branch
// depends on one. Once what is left fills no more than a vector, each of it is compared with all.
float valueByBits(const float* values, std::size_t count, std::size_t place) {
  const Keys d;
  const std::size_t lanes = hn::Lanes(d), whole = count / lanes * lanes;
  // What fills the last vector is larger than any number.
  float last[kMaxLanes];
  std::fill(std::copy(values + whole, values + count, last), last + kMaxLanes, std::numeric_limits<float>::quiet_NaN());
  const auto forEachVector = [&](const auto& visit) {
    for (std::size_t i = 0; i < whole; i += lanes) visit(keysOf(values + i));
    if (whole < count) visit(keysOf(last));
  };
  const auto countBelow = [&](std::int32_t limit) {
    std::size_t below = 0;
    forEachVector([&](Key keys) { below += hn::CountTrue(d, hn::Lt(keys, hn::Set(d, limit))); });
    return below;
  };
  constexpr std::int32_t kLargest = 0x7F7FFFFF;  // Of a finite number.
  Key lowest = keysOf(last), highest = hn::Set(d, std::numeric_limits<std::int32_t>::min());
  forEachVector([&](Key keys) {
    lowest = hn::Min(lowest, keys);
    highest = hn::Max(highest, hn::IfThenElse(hn::Gt(keys, hn::Set(d, kLargest)), highest, keys));
  });
  const std::int32_t low = hn::GetLane(hn::MinOfLanes(d, lowest)), high = hn::GetLane(hn::MaxOfLanes(d, highest));
  // The key is not below `least`, and `left` are as near to it as the bits say that are known: to begin with, those
  // that all have in common.
  std::int32_t least = 0;
  std::size_t below = 0, left = count;
  int bit = 30;
  if (low >= 0 || high < 0) {
    while (bit >= 0 && ((low ^ high) >> bit) == 0) --bit;
    least = bit < 0 ? low : low & ~static_cast<std::int32_t>((std::int64_t{2} << bit) - 1);
  } else {
    below = countBelow(0);
    left = count - below;
    if (below > place) {
      least = std::numeric_limits<std::int32_t>::min();
      left = below;
      below = 0;
    }
  }
  for (; bit >= 0 && left > lanes; --bit) {
    const std::int32_t middle = least | (std::int32_t{1} << bit);
    const std::size_t less = countBelow(middle);
    if (less > place) {
      left = less - below;
    } else {
      left -= less - below;
      below = less;
      least = middle;
    }
  }
  // Without a bit that is not known all that are left are the same.
  std::int32_t key = least;
  if (bit >= 0) {
    std::int32_t candidates[2 * kMaxLanes];
    const auto most = static_cast<std::int32_t>(std::min<std::int64_t>(kLargest, least + (std::int64_t{2} << bit) - 1));
    std::size_t found = 0;
    forEachVector([&](Key keys) {
      const auto is_left = hn::Not(hn::Or(hn::Lt(keys, hn::Set(d, least)), hn::Gt(keys, hn::Set(d, most))));
      if (hn::AllFalse(d, is_left)) return;
      hn::StoreU(hn::Compress(keys, is_left), d, candidates + found);
      found += hn::CountTrue(d, is_left);
    });
    std::fill(candidates + found, candidates + kMaxLanes, std::numeric_limits<std::int32_t>::max());
    const auto all = hn::LoadU(d, candidates);
    for (std::size_t k = 0; k < found; ++k) {
      const auto here = hn::Set(d, candidates[k]);
      key = candidates[k];
      const std::size_t less = hn::CountTrue(d, hn::Lt(all, here)),
                        not_more = lanes - hn::CountTrue(d, hn::Gt(all, here));
      if (below + less <= place && below + not_more > place) break;
    }
  }
  const std::int32_t bits = key < 0 ? key ^ std::numeric_limits<std::int32_t>::max() : key;
  return hn::GetLane(hn::BitCast(hn::RebindToFloat<Keys>(), hn::Set(d, bits)));
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::imaging
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::imaging {
namespace {

HWY_EXPORT(valueByBits);

}  // namespace

float valueAt(std::size_t place, const std::vector<float>& values) {
  return HWY_DYNAMIC_DISPATCH(valueByBits)(values.data(), values.size(), place);
}

}  // namespace angio::imaging
#endif
