// SPDX-License-Identifier: GPL-2.0-or-later
#include "block_noise.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "quantile.hpp"

namespace angio::imaging {
namespace {

// The quantile is one that vessels do not reach unless they cover half of the block. The two deviators of the second
// derivatives are independent and normal in noise, so that their length is Rayleigh's.
constexpr float kQuantile = 0.4f, kRayleigh = 1.0108f;
constexpr float kBendPerDeviator = 1.7320508f;  // Standard deviation of the bend across, in the deviators'.

}  // namespace

void BlockNoise::begin(const cv::Size& size, const NoiseSampling& sampling) {
  size_ = size;
  sampling_ = sampling;
  squares_.create(std::max(1, size.height / sampling.block), std::max(1, size.width / sampling.block), CV_32F);
  samples_.resize(static_cast<std::size_t>(squares_.cols));
  for (auto& sample : samples_) sample.clear();
  block_ = 0;
  next_ = 1;
}

void BlockNoise::addRow(const Plane& smoothed, int y) {
  while (y >= (block_ + 1) * size_.height / squares_.rows) closeBlocks();
  if (y < next_) return;
  next_ = y + sampling_.every;
  const float *above = smoothed.row(y - 1), *here = smoothed.row(y), *below = smoothed.row(y + 1);
  for (int b = 0; b < squares_.cols; ++b) {
    std::vector<float>& sample = samples_[b];
    const int x1 = std::min(size_.width - 1, (b + 1) * size_.width / squares_.cols);
    for (int x = std::max(1, b * size_.width / squares_.cols); x < x1; x += sampling_.every) {
      const float difference = 0.5f * (here[x - 1] + here[x + 1] - above[x] - below[x]);
      const float xy = 0.25f * (above[x - 1] + below[x + 1] - above[x + 1] - below[x - 1]);
      sample.push_back(difference * difference + xy * xy);
    }
  }
}

// Goes on to the next row of blocks, whose first row of pixels is looked at.
void BlockNoise::closeBlocks() {
  for (int b = 0; b < squares_.cols; ++b) {
    std::vector<float>& sample = samples_[b];
    const auto place = static_cast<std::size_t>(kQuantile * static_cast<float>(sample.size()));
    squares_.at<float>(block_, b) = sample.empty() ? 0 : valueAt(place, sample);
    sample.clear();
  }
  ++block_;
  next_ = block_ * size_.height / squares_.rows;
}

void BlockNoise::finish(float sigma, cv::Mat& noise) {
  while (block_ < squares_.rows) closeBlocks();
  const float sigma2 = sigma * sigma;
  noise.create(squares_.size(), CV_32F);
  for (int i = 0; i < static_cast<int>(noise.total()); ++i) {
    noise.ptr<float>()[i] = kBendPerDeviator * sigma2 * std::sqrt(squares_.ptr<float>()[i]) / kRayleigh;
  }
  cv::medianBlur(noise, noise, 3);
}

}  // namespace angio::imaging
