// SPDX-License-Identifier: GPL-2.0-or-later
#include "noise.hpp"

#include <cmath>
#include <cstddef>

namespace angio::simulation {
namespace {

// The place below which a share p of the standard normal distribution lies, by bisection.
double normalQuantile(double p) {
  double low = -10, high = 10;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (0.5 * std::erfc(-middle * std::sqrt(0.5)) < p ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

NormalDeviates::NormalDeviates() {
  const std::size_t n = quantiles_.size();
  std::array<double, 4096> exact{};
  double squares = 0;
  for (std::size_t i = 0; i < n; ++i) {
    exact[i] = normalQuantile((static_cast<double>(i) + 0.5) / static_cast<double>(n));
    squares += exact[i] * exact[i];
  }
  // Middles of classes vary a little less than the whole distribution.
  const double scale = std::sqrt(0.5 * static_cast<double>(n) / squares);
  for (std::size_t i = 0; i < n; ++i) quantiles_[i] = static_cast<float>(scale * exact[i]);
}

void NormalDeviates::fill(std::uint64_t key, int count, float* out) const {
  std::uint64_t counter = mixed(key);
  const auto deviate = [this](std::uint64_t bits) { return quantiles_[bits & 4095] + quantiles_[(bits >> 12) & 4095]; };
  int i = 0;
  for (; i + 1 < count; i += 2) {
    const std::uint64_t bits = mixed(counter += 0x9e3779b97f4a7c15ULL);
    out[i] = deviate(bits);
    out[i + 1] = deviate(bits >> 32);
  }
  if (i < count) out[i] = deviate(mixed(counter + 0x9e3779b97f4a7c15ULL));
}

}  // namespace angio::simulation
