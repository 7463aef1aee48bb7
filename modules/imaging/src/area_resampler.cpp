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

using FloatTag = hn::CappedTag<float, Plane::kSlack / 2>;

// The rows' sum, with their weights. What does not fill a vector goes one by one.
template <typename Grey>
void sumGrey(const WeighedRows& from, float* to) {
  const FloatTag d;
  const hn::Rebind<std::int32_t, decltype(d)> whole;
  const hn::Rebind<Grey, decltype(d)> stored;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto greyOf = [&](int k) { return reinterpret_cast<const Grey*>(from.rows[k]); };
  const auto valuesAt = [&](const Grey* row, int at) {
    return hn::ConvertTo(d, hn::PromoteTo(whole, hn::LoadU(stored, row + at)));
  };
  int i = 0;
  for (; i + 2 * lanes <= from.width; i += 2 * lanes) {  // Half of the weights and rows have to be looked up.
    auto sum = hn::Zero(d), next = hn::Zero(d);
    for (int k = 0; k < from.count; ++k) {
      const auto weight = hn::Set(d, from.weights[k]);
      const Grey* const row = greyOf(k);
      sum = hn::MulAdd(weight, valuesAt(row, i), sum);
      next = hn::MulAdd(weight, valuesAt(row, i + lanes), next);
    }
    hn::StoreU(sum, d, to + i);
    hn::StoreU(next, d, to + i + lanes);
  }
  for (; i < from.width; ++i) {
    float sum = 0;
    for (int k = 0; k < from.count; ++k) sum = from.weights[k] * static_cast<float>(greyOf(k)[i]) + sum;
    to[i] = sum;
  }
}

void sumGrey8(const WeighedRows& from, float* to) { sumGrey<std::uint8_t>(from, to); }

void sumGrey16(const WeighedRows& from, float* to) { sumGrey<std::uint16_t>(from, to); }

// New pixels of a row, whole vectors of them. Where an image is shrunk to no less than half, what a vector takes lies
// in two vectors, and is picked out of them: to gather it takes ten times as long.
void shrinkRow(const float* from, const int* first, const float* weight, int taps, int stride, int count, float* to) {
  const FloatTag d;
  const hn::Rebind<std::int32_t, decltype(d)> whole;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < count; i += lanes) {
    const auto place = hn::LoadU(whole, first + i);
    auto sum = hn::Zero(d);
    if (first[i + lanes - 1] - first[i] < 2 * lanes) {
      const auto away = hn::Sub(place, hn::Set(whole, first[i]));
      const auto lane = hn::IndicesFromVec(d, hn::And(away, hn::Set(whole, lanes - 1)));
      const auto is_near = hn::RebindMask(d, hn::Lt(away, hn::Set(whole, lanes)));
      for (int k = 0; k < taps; ++k) {
        const float* const here = from + first[i] + k;
        const auto values = hn::IfThenElse(is_near, hn::TableLookupLanes(hn::LoadU(d, here), lane),
                                           hn::TableLookupLanes(hn::LoadU(d, here + lanes), lane));
        sum = hn::MulAdd(hn::LoadU(d, weight + k * stride + i), values, sum);
      }
      hn::StoreU(sum, d, to + i);
      continue;
    }
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

HWY_EXPORT(sumGrey8);
HWY_EXPORT(sumGrey16);
HWY_EXPORT(shrinkRow);

}  // namespace

void AreaResampler::prepare(Axis& axis, int from, int to) {
  if (axis.from == from && axis.to == to) return;
  const double step = static_cast<double>(from) / to;
  axis.from = from;
  axis.to = to;
  axis.taps = static_cast<int>(std::ceil(step)) + 1;
  axis.stride = to + Plane::kSlack;
  // What fills the last vector is near to its pixels.
  axis.first.assign(axis.stride, static_cast<int>((to - 1) * step));
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
  // The last taps weigh nothing, but are read, and vectors are read past them.
  row_.resize(static_cast<std::size_t>(image.cols) + across_.taps + Plane::kSlack);
  for (int y = 0; y < size.height; ++y) {
    rows_.clear();
    weights_.clear();
    for (int k = 0; k < down_.taps; ++k) {
      const float weight = down_.weight[static_cast<std::size_t>(k) * down_.stride + y];
      if (!(weight > 0)) continue;
      rows_.push_back(image.ptr(down_.first[y] + k));
      weights_.push_back(weight);
    }
    const WeighedRows rows{rows_.data(), weights_.data(), static_cast<int>(rows_.size()), image.cols};
    if (image.depth() == CV_8U) {
      HWY_DYNAMIC_DISPATCH(sumGrey8)(rows, row_.data());
    } else {
      HWY_DYNAMIC_DISPATCH(sumGrey16)(rows, row_.data());
    }
    HWY_DYNAMIC_DISPATCH(shrinkRow)
    (row_.data(), across_.first.data(), across_.weight.data(), across_.taps, across_.stride, size.width, to.row(y));
  }
}

}  // namespace angio::imaging
#endif
