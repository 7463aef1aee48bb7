// SPDX-License-Identifier: GPL-2.0-or-later
#include "area_resampler.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

// Compiled once for every vector target by the include below; the best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "area_resampler.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace angio::imaging {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Adds a row of grey values to `sum`, weighted; the first one is put there. What does not fill a vector goes one by
// one.
template <typename Grey>
void addRow(const Grey* grey, float weight, bool first, int count, float* sum) {
  const hn::CappedTag<float, Plane::kSlack / 2> d;
  const hn::Rebind<std::int32_t, decltype(d)> whole;
  const hn::Rebind<Grey, decltype(d)> stored;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto by = hn::Set(d, weight);
  int i = 0;
  for (; i + lanes <= count; i += lanes) {
    const auto value = hn::ConvertTo(d, hn::PromoteTo(whole, hn::LoadU(stored, grey + i)));
    const auto before = first ? hn::Zero(d) : hn::LoadU(d, sum + i);
    hn::StoreU(hn::MulAdd(by, value, before), d, sum + i);
  }
  for (; i < count; ++i) sum[i] = weight * static_cast<float>(grey[i]) + (first ? 0 : sum[i]);
}

void addRow8(const std::uint8_t* grey, float weight, bool first, int count, float* sum) {
  addRow(grey, weight, first, count, sum);
}

void addRow16(const std::uint16_t* grey, float weight, bool first, int count, float* sum) {
  addRow(grey, weight, first, count, sum);
}

// New pixels of a row, whole vectors of them.
void shrinkRow(const float* from, const int* first, const float* weight, int taps, int stride, int count, float* to) {
  const hn::CappedTag<float, Plane::kSlack / 2> d;
  const hn::Rebind<std::int32_t, decltype(d)> whole;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < count; i += lanes) {
    const auto place = hn::LoadU(whole, first + i);
    auto sum = hn::Zero(d);
    for (int k = 0; k < taps; ++k) {
      sum = hn::MulAdd(hn::LoadU(d, weight + k * stride + i), hn::GatherIndex(d, from + k, place), sum);
    }
    hn::StoreU(sum, d, to + i);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::imaging
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::imaging {
namespace {

HWY_EXPORT(addRow8);
HWY_EXPORT(addRow16);
HWY_EXPORT(shrinkRow);

}  // namespace

void AreaResampler::prepare(Axis& axis, int from, int to) {
  if (axis.from == from && axis.to == to) return;
  const double step = static_cast<double>(from) / to;
  axis.from = from;
  axis.to = to;
  axis.taps = static_cast<int>(std::ceil(step)) + 1;
  axis.stride = to + Plane::kSlack;
  axis.first.assign(static_cast<std::size_t>(axis.stride), 0);
  axis.weight.assign(static_cast<std::size_t>(axis.stride) * axis.taps, 0);
  for (int i = 0; i < to; ++i) {
    const double begin = i * step, end = std::min((i + 1) * step, static_cast<double>(from));
    axis.first[i] = static_cast<int>(begin);
    for (int k = 0; k < axis.taps; ++k) {
      const double covered = std::min(end, axis.first[i] + k + 1.0) - std::max(begin, axis.first[i] + 1.0 * k);
      axis.weight[static_cast<std::size_t>(k) * axis.stride + i] = static_cast<float>(std::max(0.0, covered) / step);
    }
  }
}

void AreaResampler::operator()(const cv::Mat& image, const cv::Size& size, Plane& to) {
  prepare(across_, image.cols, size.width);
  prepare(down_, image.rows, size.height);
  to.resize(size.width, size.height);
  row_.resize(static_cast<std::size_t>(image.cols) + across_.taps);  // The last taps weigh nothing, but are read.
  for (int y = 0; y < size.height; ++y) {
    for (int k = 0; k < down_.taps; ++k) {
      const float weight = down_.weight[static_cast<std::size_t>(k) * down_.stride + y];
      if (!(weight > 0)) continue;
      if (image.depth() == CV_8U) {
        HWY_DYNAMIC_DISPATCH(addRow8)(image.ptr(down_.first[y] + k), weight, k == 0, image.cols, row_.data());
      } else {
        const auto* grey = image.ptr<std::uint16_t>(down_.first[y] + k);
        HWY_DYNAMIC_DISPATCH(addRow16)(grey, weight, k == 0, image.cols, row_.data());
      }
    }
    HWY_DYNAMIC_DISPATCH(shrinkRow)
    (row_.data(), across_.first.data(), across_.weight.data(), across_.taps, across_.stride, size.width, to.row(y));
  }
}

}  // namespace angio::imaging
#endif
