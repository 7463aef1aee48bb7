// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "angio/plotting/plot.hpp"

namespace angio::plotting {

/// One axis: values to positions along it.
struct Scale {
  double low = 0, high = 1;
  bool log = false;
  double begin = 0, end = 1;  ///< Positions of low and high.

  /// Whether a value is of use: what lies beyond thirty decades is a mistake, and would leave no room for the rest.
  bool shows(double value) const { return std::abs(value) < 1e30 && (!log || value > 1e-30); }
  double at(double value) const {
    const auto scaled = [&](double v) { return log ? std::log10(v) : v; };
    const double share = (scaled(value) - scaled(low)) / (scaled(high) - scaled(low));
    return begin + std::clamp(share, -20.0, 20.0) * (end - begin);  // Far outside is as good as further.
  }
};

/// Returns the axis on which all of a plot's series and guides are seen, upright or along; positions are still 0 to 1.
Scale scaleOf(const Plot& plot, bool upright);

/// Returns about so many round values on an axis, with their words; or those that it was given.
std::vector<std::pair<double, std::string>> ticksOf(const PlotAxis& axis, const Scale& scale, int about);

}  // namespace angio::plotting
