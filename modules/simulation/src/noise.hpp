// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <cstdint>

#include "angio/simulation/namespace.hpp"

namespace angio::simulation {

/// The finaliser of splitmix64: a bijection that leaves no bit of the input visible.
/// Source: Steele, Lea, Flood, Fast splittable pseudorandom number generators, OOPSLA 2014.
constexpr std::uint64_t mixed(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

/// Standard normal deviates by table, the same on every machine.
class NormalDeviates {
 public:
  NormalDeviates();

  /// Fills `out` with `count` deviates. Each key gives a stream of its own.
  void fill(std::uint64_t key, int count, float* out) const;

 private:
  // Quantiles of the normal distribution with variance 1/2: a deviate is the sum of two, which has 2^24 values and
  // reaches beyond five standard deviations, from a table that stays in the first cache.
  std::array<float, 4096> quantiles_;
};

}  // namespace angio::simulation
