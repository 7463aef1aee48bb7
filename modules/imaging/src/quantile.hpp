// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// Returns the value that has `place` others below it, of finite ones, of which there are more than that.
float valueAt(std::size_t place, const std::vector<float>& values);

/// Returns the value that this part of the others is below, 0 for the smallest and 1 for the largest.
template <typename Part>
float quantileOf(const std::vector<float>& values, Part part) {
  return valueAt(static_cast<std::size_t>(part * static_cast<Part>(values.size() - 1)), values);
}

/// Returns the middle value, of two the upper one.
inline float medianOf(const std::vector<float>& values) { return valueAt(values.size() / 2, values); }

}  // namespace angio::imaging
