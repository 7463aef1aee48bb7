// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

#include "angio/base/namespace.hpp"

namespace angio::base {

/// Returns 0 to n - 1 in random order (Fisher and Yates; std::shuffle differs between libraries).
/// @param uniform  Gives the next number in [0, 1).
template <typename Uniform>
std::vector<int> shuffled(int n, const Uniform& uniform) {
  std::vector<int> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  for (int i = n - 1; i > 0; --i) std::swap(order[i], order[std::min(i, static_cast<int>(uniform() * (i + 1)))]);
  return order;
}

}  // namespace angio::base
