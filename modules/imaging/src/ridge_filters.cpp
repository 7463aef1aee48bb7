// SPDX-License-Identifier: GPL-2.0-or-later
#include "ridge_filters.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

// Compiled once for every vector target by the include below; the best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ridge_filters.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h.
#include <hwy/contrib/math/math-inl.h>

HWY_BEFORE_NAMESPACE();
namespace angio::imaging {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::CappedTag<float, Plane::kSlack / 2>;

void absorptionRow(float* values, int count, float offset, float level) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto plus = hn::Set(d, offset), top = hn::Set(d, level);
  for (int i = 0; i < count; i += lanes) {
    hn::StoreU(hn::Sub(top, hn::Log(d, hn::Add(hn::LoadU(d, values + i), plus))), d, values + i);
  }
}

// Symmetric sum of rows: weight[0] * rows[0] + sum over k of weight[k] * (rows[2 k - 1] + rows[2 k]).
void sumRows(const float* const* rows, const float* weight, int reach, int count, float* to) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < count; i += lanes) {
    auto sum = hn::Mul(hn::Set(d, weight[0]), hn::LoadU(d, rows[0] + i));
    for (int k = 1; k <= reach; ++k) {
      const auto pair = hn::Add(hn::LoadU(d, rows[2 * k - 1] + i), hn::LoadU(d, rows[2 * k] + i));
      sum = hn::MulAdd(hn::Set(d, weight[k]), pair, sum);
    }
    hn::StoreU(sum, d, to + i);
  }
}

// The same along a row, whose `reach` neighbours to both sides can be read.
void sumAlong(const float* from, const float* weight, int reach, int count, float* to) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < count; i += lanes) {
    auto sum = hn::Mul(hn::Set(d, weight[0]), hn::LoadU(d, from + i));
    for (int k = 1; k <= reach; ++k) {
      sum = hn::MulAdd(hn::Set(d, weight[k]), hn::Add(hn::LoadU(d, from + i - k), hn::LoadU(d, from + i + k)), sum);
    }
    hn::StoreU(sum, d, to + i);
  }
}

// Pixels 1 to width - 2 of a row; `rows` are the row above, this one and the one below.
void strengthRow(const float* const* rows, const float* least, int width, float sigma, float reach, float* to) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto half = hn::Set(d, 0.5f), quarter = hn::Set(d, 0.25f), zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const auto sigma2 = hn::Set(d, sigma * sigma), per_sigma2 = hn::Set(d, 1 / (sigma * sigma)), far = hn::Set(d, reach);
  const float *above = rows[0], *here = rows[1], *below = rows[2];
  const auto at = [&](const float* row, int i) { return hn::LoadU(d, row + i); };
  // The last vector is moved back onto the row instead of running past it.
  for (int first = 1; first < width - 1; first += lanes) {
    const int i = std::max(1, std::min(first, width - 1 - lanes));
    const auto middle = at(here, i), left = at(here, i - 1), right = at(here, i + 1);
    const auto up = at(above, i), down = at(below, i);
    const auto twice = hn::Add(middle, middle);
    const auto xx = hn::Sub(hn::Add(left, right), twice), yy = hn::Sub(hn::Add(up, down), twice);
    const auto xy = hn::Mul(
        quarter, hn::Sub(hn::Add(at(above, i - 1), at(below, i + 1)), hn::Add(at(above, i + 1), at(below, i - 1))));
    const auto mean = hn::Mul(half, hn::Add(xx, yy)), difference = hn::Mul(half, hn::Sub(xx, yy));
    const auto root2 = hn::MulAdd(difference, difference, hn::Mul(xy, xy));
    // Most of an image bends too little: that needs no root.
    const auto needed = hn::MulAdd(at(least, i), per_sigma2, mean);
    if (hn::AllFalse(d, hn::Or(hn::Lt(needed, zero), hn::Gt(root2, hn::Mul(needed, needed))))) {
      hn::StoreU(zero, d, to + i);
      continue;
    }
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
    const auto line = hn::And(hn::Gt(strength, at(least, i)), hn::Lt(slope2, hn::Mul(allowed, allowed)));
    hn::StoreU(hn::IfThenElseZero(line, strength), d, to + i);
  }
}

// Adds a row of grey values to `sum`, weighted; the first one is put there. What does not fill a vector goes one by
// one.
template <typename Grey>
void addRow(const Grey* grey, float weight, bool first, int count, float* sum) {
  const FloatTag d;
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
  const FloatTag d;
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

HWY_EXPORT(absorptionRow);
HWY_EXPORT(sumRows);
HWY_EXPORT(sumAlong);
HWY_EXPORT(strengthRow);
HWY_EXPORT(addRow8);
HWY_EXPORT(addRow16);
HWY_EXPORT(shrinkRow);

constexpr int kMaxReach = 32;

// A row with its edges repeated to both sides; the middle begins at `margin`.
void repeatEdges(std::vector<float>& row, int margin, int width) {
  std::fill(row.begin(), row.begin() + margin, row[margin]);
  std::fill(row.begin() + margin + width, row.begin() + 2 * margin + width + Plane::kSlack, row[margin + width - 1]);
}

void filterRow(const Plane& from, int y, const std::vector<float>& weight, std::vector<float>& row, float* to) {
  const int reach = static_cast<int>(weight.size()) - 1, width = from.width(), last = from.height() - 1;
  const float* rows[2 * kMaxReach + 1];
  rows[0] = from.row(y);
  for (int k = 1; k <= reach; ++k) {
    rows[2 * k - 1] = from.row(std::max(0, y - k));
    rows[2 * k] = from.row(std::min(last, y + k));
  }
  HWY_DYNAMIC_DISPATCH(sumRows)(rows, weight.data(), reach, width, row.data() + reach);
  repeatEdges(row, reach, width);
  HWY_DYNAMIC_DISPATCH(sumAlong)(row.data() + reach, weight.data(), reach, width, to);
}

void makeLab(std::vector<float>& row, int width, std::size_t reach) {
  const std::size_t wanted = static_cast<std::size_t>(width) + 2 * reach + 2 * Plane::kSlack;
  if (row.size() < wanted) row.resize(wanted);
}

}  // namespace

void toAbsorption(Plane& values, float offset, float level) {
  for (int y = 0; y < values.height(); ++y) {
    HWY_DYNAMIC_DISPATCH(absorptionRow)(values.row(y), values.width(), offset, level);
  }
}

GaussianFilter::GaussianFilter(float sigma) {
  const int reach = std::clamp(static_cast<int>(std::ceil(3 * sigma)), 1, kMaxReach);
  float total = 0;
  for (int k = 0; k <= reach; ++k) {
    weight_.push_back(std::exp(-0.5f * static_cast<float>(k * k) / std::max(sigma * sigma, 1e-4f)));
    total += (k == 0 ? 1 : 2) * weight_.back();
  }
  for (float& w : weight_) w /= total;
}

void GaussianFilter::operator()(const Plane& from, Plane& to) const {
  to.resize(from.width(), from.height());
  makeLab(row_, from.width(), weight_.size());
  for (int y = 0; y < from.height(); ++y) filterRow(from, y, weight_, row_, to.row(y));
}

void halve(const Plane& from, Plane& to, Plane& buffer) {
  static const std::vector<float> kBinomial{6.0f / 16, 4.0f / 16, 1.0f / 16};
  std::vector<float> row;
  makeLab(row, from.width(), kBinomial.size());
  buffer.resize(from.width(), 1);
  to.resize((from.width() + 1) / 2, (from.height() + 1) / 2);
  for (int y = 0; y < to.height(); ++y) {
    filterRow(from, 2 * y, kBinomial, row, buffer.row(0));
    const float* filtered = buffer.row(0);
    float* out = to.row(y);
    for (int x = 0; x < to.width(); ++x) out[x] = filtered[2 * x];
  }
}

void ridgeStrength(const Plane& smoothed, float sigma, float reach, const cv::Mat& least, Plane& strength) {
  const int width = smoothed.width(), height = smoothed.height();
  strength.resize(width, height);
  std::fill(strength.row(0), strength.row(0) + width, 0.0f);
  std::fill(strength.row(height - 1), strength.row(height - 1) + width, 0.0f);
  std::vector<float> threshold(static_cast<std::size_t>(width) + Plane::kSlack);
  int block = -1;
  for (int y = 1; y + 1 < height; ++y) {
    if (y * least.rows / height != block) {
      block = y * least.rows / height;
      for (int x = 0; x < width; ++x) threshold[x] = least.at<float>(block, x * least.cols / width);
    }
    const float* rows[] = {smoothed.row(y - 1), smoothed.row(y), smoothed.row(y + 1)};
    HWY_DYNAMIC_DISPATCH(strengthRow)(rows, threshold.data(), width, sigma, reach, strength.row(y));
    strength.row(y)[0] = strength.row(y)[width - 1] = 0;
  }
}

void AreaResampler::prepare(Axis& axis, int from, int to) {
  if (axis.from == from && axis.to == to) return;
  const double step = static_cast<double>(from) / to;
  axis.from = from;
  axis.to = to;
  axis.taps = static_cast<int>(std::ceil(step)) + 1;
  axis.stride = to + Plane::kSlack;
  axis.first.assign(axis.stride, 0);
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
