// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <thread>
#include <vector>

#include "angio/base/namespace.hpp"

namespace angio::base {

/// Rows of an image for one thread, [top, bottom).
struct RowBand {
  int index, top, bottom;
};

/// Shares the rows out to `threads` threads, the caller's among them, and waits for all. What `work` (RowBand) does to
/// a row must not depend on the other rows' turn: then the number of threads cannot be seen in the result.
/// @param step  Bands begin at multiples of it.
template <typename Work>
void forBands(int threads, int rows, const Work& work, int step = 1) {
  const int steps = (rows + step - 1) / step;
  const int bands = std::max(1, std::min(threads, steps));
  const auto band = [&](int b) {
    return RowBand{b, steps * b / bands * step, std::min(rows, steps * (b + 1) / bands * step)};
  };
  std::vector<std::thread> others;
  for (int b = 1; b < bands; ++b) others.emplace_back([&work, one = band(b)] { work(one); });
  work(band(0));
  for (std::thread& other : others) other.join();
}

}  // namespace angio::base
