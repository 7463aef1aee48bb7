// SPDX-License-Identifier: GPL-2.0-or-later
#include "ridge_classes.hpp"

#include <algorithm>

#include "line_plane.hpp"

// Compiled once for every vector target by the include below; the best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ridge_classes.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace angio::imaging {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::CappedTag<float, Plane::kSlack / 2>;

constexpr int kBlock = LinePlane::kBlock;

void classifyRow(const LinePixels& pixels, const RowRange& part, float weakest, float strong_salience,
                 std::uint8_t* to) {
  const FloatTag d;
  const hn::RebindToSigned<FloatTag> whole;
  const hn::Rebind<std::uint8_t, FloatTag> bytes;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto least = hn::Set(d, weakest), strong = hn::Set(d, strong_salience);
  const auto one = hn::Set(whole, 1);
  for (int first = part.begin / kBlock * kBlock; first < part.end; first += kBlock) {
    if (pixels.marks[first / kBlock] == 0) continue;
    std::uint8_t classes[kBlock];
    for (int k = 0; k < kBlock; k += lanes) {
      const auto is_line = hn::Gt(hn::LoadU(d, pixels.strength + first + k), least);
      const auto is_strong = hn::And(is_line, hn::Gt(hn::LoadU(d, pixels.salience + first + k), strong));
      const auto line = hn::IfThenElseZero(hn::RebindMask(whole, is_line), one);
      const auto more = hn::IfThenElseZero(hn::RebindMask(whole, is_strong), one);
      hn::StoreU(hn::DemoteTo(bytes, hn::Add(line, more)), bytes, classes + k);
    }
    const int begin = std::max(part.begin, first), end = std::min(part.end, first + kBlock);
    std::copy_n(classes + (begin - first), end - begin, to + begin);
  }
}

// How many; whole vectors are written.
int salientOfRow(const LinePixels& pixels, float strong_salience, float* to) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto strong = hn::Set(d, strong_salience);
  int count = 0;
  for (int i = 0; i < pixels.width; i += lanes) {
    if (pixels.marks[i / kBlock] == 0) continue;
    const auto inside = hn::FirstN(d, static_cast<std::size_t>(pixels.width - i));
    const auto salient = hn::And(inside, hn::Gt(hn::LoadU(d, pixels.salience + i), strong));
    hn::StoreU(hn::Compress(hn::LoadU(d, pixels.strength + i), salient), d, to + count);
    count += static_cast<int>(hn::CountTrue(d, salient));
  }
  return count;
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::imaging
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::imaging {

HWY_EXPORT(classifyRow);
HWY_EXPORT(salientOfRow);

void classifyRidge(const LinePixels& pixels, const RowRange& part, float weakest, float strong_salience,
                   std::uint8_t* to) {
  HWY_DYNAMIC_DISPATCH(classifyRow)(pixels, part, weakest, strong_salience, to);
}

void addSalient(const LinePixels& pixels, float strong_salience, std::vector<float>& values) {
  const std::size_t before = values.size();
  values.resize(before + static_cast<std::size_t>(pixels.width) + Plane::kSlack);
  const int added = HWY_DYNAMIC_DISPATCH(salientOfRow)(pixels, strong_salience, values.data() + before);
  values.resize(before + static_cast<std::size_t>(added));
}

}  // namespace angio::imaging
#endif
