// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>

#include "detector.hpp"

namespace angio::simulation {

/// Uniform random numbers, the same on every machine.
class Uniform {
 public:
  explicit Uniform(std::uint64_t seed) : state_(mixed(seed)) {}
  double operator()(double low, double high) {
    state_ += 0x9e3779b97f4a7c15ULL;
    return low + (high - low) * static_cast<double>(mixed(state_) >> 11) * 0x1p-53;
  }

 private:
  std::uint64_t state_;
};

}  // namespace angio::simulation
