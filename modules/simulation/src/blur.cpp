// SPDX-License-Identifier: GPL-2.0-or-later
#include "blur.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/row_bands.hpp"

// Compiled once for every vector target by the include below, which is chosen from at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "blur.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace angio::simulation {
namespace HWY_NAMESPACE {

// The compiler makes vectors of both.
void scale(const float* __restrict in, float weight, int count, float* __restrict out) {
  for (int i = 0; i < count; ++i) out[i] = weight * in[i];
}

void addBoth(const float* a, const float* b, float weight, int count, float* __restrict out) {
  for (int i = 0; i < count; ++i) out[i] += weight * (a[i] + b[i]);
}

}  // namespace HWY_NAMESPACE
}  // namespace angio::simulation
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::simulation {
namespace {

HWY_EXPORT(scale);
HWY_EXPORT(addBoth);

}  // namespace

Blur::Blur(double std_px) : half_{1.0F} {
  if (std_px < 0.27) return;  // exp(-1 / 2 sigma^2) is a thousandth.
  half_.clear();
  double sum = -1;
  for (int i = 0; i <= 4 * std_px; ++i) {
    const double weight = std::exp(-0.5 * i * i / (std_px * std_px));
    if (weight < 5e-4) break;  // Of the middle's: such a neighbour's part is below a hundredth of its own noise.
    half_.push_back(static_cast<float>(weight));
    sum += 2 * weight;
  }
  for (float& weight : half_) weight = static_cast<float>(weight / sum);
}

void Blur::apply(const cv::Mat& in, cv::Mat& out, int threads) {
  const int width = in.cols, reach = static_cast<int>(half_.size()) - 1;
  out.create(in.size(), CV_32FC1);
  rows_.resize(std::max<std::size_t>(rows_.size(), threads));
  forBands(threads, in.rows, [&](const RowBand& band) {
    std::vector<float>& row = rows_[band.index];
    row.resize(width + 2 * reach);
    float* middle = row.data() + reach;
    for (int y = band.top; y < band.bottom; ++y) {
      HWY_DYNAMIC_DISPATCH(scale)(in.ptr<float>(y), half_[0], width, middle);
      for (int k = 1; k <= reach; ++k) {
        HWY_DYNAMIC_DISPATCH(addBoth)
        (in.ptr<float>(std::max(y - k, 0)), in.ptr<float>(std::min(y + k, in.rows - 1)), half_[k], width, middle);
      }
      std::fill(row.data(), middle, middle[0]);
      std::fill(middle + width, middle + width + reach, middle[width - 1]);
      float* result = out.ptr<float>(y);
      HWY_DYNAMIC_DISPATCH(scale)(middle, half_[0], width, result);
      for (int k = 1; k <= reach; ++k) HWY_DYNAMIC_DISPATCH(addBoth)(middle - k, middle + k, half_[k], width, result);
    }
  });
}

}  // namespace angio::simulation
#endif  // HWY_ONCE
