// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

#include "angio/base/namespace.hpp"

namespace angio::base {

/// Sets of the numbers below `count` that grow together (union-find): first each by itself.
class Groups {
 public:
  explicit Groups(std::size_t count) : leader_(count) { std::iota(leader_.begin(), leader_.end(), 0); }

  /// Returns the number that stands for the set of `i`: the least in it.
  int of(int i) {
    while (leader_[i] != i) {
      int& leader = leader_[i];
      leader = leader_[leader];
      i = leader;
    }
    return i;
  }

  /// Returns false when both are in one set already.
  bool join(int a, int b) {
    a = of(a), b = of(b);
    if (a == b) return false;
    leader_[std::max(a, b)] = std::min(a, b);
    return true;
  }

 private:
  std::vector<int> leader_;
};

}  // namespace angio::base
