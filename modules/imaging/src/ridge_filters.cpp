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

// Two vectors at a time: half of the weights and rows have to be looked up, and sums wait less for each other. Rows
// have room for both.
//
// Symmetric sum of rows: weight[0] * rows[0] + sum over k of weight[k] * (rows[2 k - 1] + rows[2 k]).
void sumRows(const float* const* rows, const float* weight, int reach, int count, float* to) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < count; i += 2 * lanes) {
    const int j = i + lanes;
    const auto middle = hn::Set(d, weight[0]);
    auto sum = hn::Mul(middle, hn::LoadU(d, rows[0] + i)), next = hn::Mul(middle, hn::LoadU(d, rows[0] + j));
    for (int k = 1; k <= reach; ++k) {
      const float *one = rows[2 * k - 1], *other = rows[2 * k];
      const auto by = hn::Set(d, weight[k]);
      sum = hn::MulAdd(by, hn::Add(hn::LoadU(d, one + i), hn::LoadU(d, other + i)), sum);
      next = hn::MulAdd(by, hn::Add(hn::LoadU(d, one + j), hn::LoadU(d, other + j)), next);
    }
    hn::StoreU(sum, d, to + i);
    hn::StoreU(next, d, to + j);
  }
}

// The same for two filters, the second one of no less reach: what both take of the rows is read once.
void sumRowsTwice(const float* const* rows, const PairOfWeights& by, int count, float* to, float* to_other) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < count; i += 2 * lanes) {
    const int j = i + lanes;
    const auto here = hn::LoadU(d, rows[0] + i), beside = hn::LoadU(d, rows[0] + j);
    const auto middle = hn::Set(d, by.weight[0]), other_middle = hn::Set(d, by.other[0]);
    auto sum = hn::Mul(middle, here), next = hn::Mul(middle, beside);
    auto other_sum = hn::Mul(other_middle, here), other_next = hn::Mul(other_middle, beside);
    int k = 1;
    for (; k <= by.reach; ++k) {
      const float *one = rows[2 * k - 1], *other = rows[2 * k];
      const auto pair = hn::Add(hn::LoadU(d, one + i), hn::LoadU(d, other + i));
      const auto next_pair = hn::Add(hn::LoadU(d, one + j), hn::LoadU(d, other + j));
      const auto weight = hn::Set(d, by.weight[k]), other_weight = hn::Set(d, by.other[k]);
      sum = hn::MulAdd(weight, pair, sum);
      next = hn::MulAdd(weight, next_pair, next);
      other_sum = hn::MulAdd(other_weight, pair, other_sum);
      other_next = hn::MulAdd(other_weight, next_pair, other_next);
    }
    for (; k <= by.other_reach; ++k) {
      const float *one = rows[2 * k - 1], *other = rows[2 * k];
      const auto weight = hn::Set(d, by.other[k]);
      other_sum = hn::MulAdd(weight, hn::Add(hn::LoadU(d, one + i), hn::LoadU(d, other + i)), other_sum);
      other_next = hn::MulAdd(weight, hn::Add(hn::LoadU(d, one + j), hn::LoadU(d, other + j)), other_next);
    }
    hn::StoreU(sum, d, to + i);
    hn::StoreU(next, d, to + j);
    hn::StoreU(other_sum, d, to_other + i);
    hn::StoreU(other_next, d, to_other + j);
  }
}

// The same along a row, whose `reach` neighbours to both sides can be read.
void sumAlong(const float* from, const float* weight, int reach, int count, float* to) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < count; i += 2 * lanes) {
    const float *here = from + i, *beside = here + lanes;
    const auto middle = hn::Set(d, weight[0]);
    auto sum = hn::Mul(middle, hn::LoadU(d, here)), next = hn::Mul(middle, hn::LoadU(d, beside));
    for (int k = 1; k <= reach; ++k) {
      const auto by = hn::Set(d, weight[k]);
      sum = hn::MulAdd(by, hn::Add(hn::LoadU(d, here - k), hn::LoadU(d, here + k)), sum);
      next = hn::MulAdd(by, hn::Add(hn::LoadU(d, beside - k), hn::LoadU(d, beside + k)), next);
    }
    hn::StoreU(sum, d, to + i);
    hn::StoreU(next, d, to + i + lanes);
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
HWY_EXPORT(sumRowsTwice);
HWY_EXPORT(sumAlong);

// A row with its edges repeated to both sides; the middle begins at `margin`.
void repeatEdges(std::vector<float>& row, int margin, int width) {
  std::fill(row.begin(), row.begin() + margin, row[margin]);
  std::fill(row.begin() + margin + width, row.begin() + 2 * margin + width + Plane::kSlack, row[margin + width - 1]);
}

}  // namespace

void toAbsorption(float* values, int count, float offset, float level) {
  HWY_DYNAMIC_DISPATCH(absorptionRow)(values, count, offset, level);
}

RowFilter gaussianFilter(float sigma) {
  const int reach = std::clamp(static_cast<int>(std::ceil(3 * sigma)), 1, RowFilter::kMaxReach);
  std::vector<float> weights;
  float total = 0;
  for (int k = 0; k <= reach; ++k) {
    weights.push_back(std::exp(-0.5f * static_cast<float>(k * k) / std::max(sigma * sigma, 1e-4f)));
    total += (k == 0 ? 1 : 2) * weights.back();
  }
  for (float& w : weights) w /= total;
  return RowFilter(std::move(weights));
}

void RowFilter::Rows::gather(const Plane& from, int y, int reach) {
  const int last = from.height() - 1;
  row[0] = from.row(y);
  for (int k = 1; k <= reach; ++k) {
    row[2 * k - 1] = from.row(std::max(0, y - k));
    row[2 * k] = from.row(std::min(last, y + k));
  }
}

void RowFilter::makeRoom(int width) {
  const std::size_t wanted = static_cast<std::size_t>(width) + 2 * weight_.size() + 2 * Plane::kSlack;
  if (row_.size() < wanted) row_.resize(wanted);
}

void RowFilter::finish(int width, float* to) {
  const int reach = this->reach();
  repeatEdges(row_, reach, width);
  HWY_DYNAMIC_DISPATCH(sumAlong)(row_.data() + reach, weight_.data(), reach, width, to);
}

void RowFilter::row(const Plane& from, int y, float* to) {
  const int reach = this->reach(), width = from.width();
  makeRoom(width);
  Rows rows;
  rows.gather(from, y, reach);
  HWY_DYNAMIC_DISPATCH(sumRows)(rows.row, weight_.data(), reach, width, row_.data() + reach);
  finish(width, to);
}

void RowFilter::row(const Plane& from, int y, float* to, RowFilter& wider, float* to_wider) {
  const int reach = this->reach(), width = from.width();
  makeRoom(width);
  wider.makeRoom(width);
  Rows rows;
  rows.gather(from, y, wider.reach());
  const PairOfWeights weights{weight_.data(), wider.weight_.data(), reach, wider.reach()};
  HWY_DYNAMIC_DISPATCH(sumRowsTwice)
  (rows.row, weights, width, row_.data() + reach, wider.row_.data() + wider.reach());
  finish(width, to);
  wider.finish(width, to_wider);
}

void Halving::row(const Plane& from, int y, float* to) {
  filtered_.resize(static_cast<std::size_t>(from.width()) + Plane::kSlack);
  binomial_.row(from, y, filtered_.data());
  for (int x = 0; 2 * x < from.width(); ++x) to[x] = filtered_[2 * x];
}

}  // namespace angio::imaging
#endif
