// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <vector>

#include "centre_lines.hpp"

namespace angio::imaging {

/// The image resolves no radius below this one [working px]: blur takes what is missing from the contrast.
constexpr float kMinResolvedRadius = 0.5f;

/// Contrast over radius at the first `count` points of a line [1/working px]: what its content absorbs per length, up
/// to a factor.
inline std::vector<float> densitiesAlong(const CentreLine& line, std::size_t count) {
  std::vector<float> densities(count);
  for (std::size_t i = 0; i < count; ++i) {
    densities[i] = line.contrast[i] / std::max(line.radius[i], kMinResolvedRadius);
  }
  return densities;
}

}  // namespace angio::imaging
