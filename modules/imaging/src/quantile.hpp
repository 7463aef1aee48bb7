// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace angio::imaging {

/// Returns the value that has so many others below it; brings the values into another order.
inline float valueAt(std::size_t place, std::vector<float>& values) {
  const auto found = values.begin() + static_cast<std::ptrdiff_t>(place);
  std::nth_element(values.begin(), found, values.end());
  return *found;
}

/// Returns the value that this part of the others is below, 0 for the smallest and 1 for the largest.
template <typename Part>
float quantileOf(std::vector<float>& values, Part part) {
  return valueAt(static_cast<std::size_t>(part * static_cast<Part>(values.size() - 1)), values);
}

/// Returns the middle value, of two the upper one.
inline float medianOf(std::vector<float> values) { return valueAt(values.size() / 2, values); }

}  // namespace angio::imaging
