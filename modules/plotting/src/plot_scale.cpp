// SPDX-License-Identifier: GPL-2.0-or-later
#include "plot_scale.hpp"

#include <iterator>
#include <tuple>

#include "angio/base/formatted.hpp"

namespace angio::plotting {

Scale scaleOf(const Plot& plot, bool upright) {
  const PlotAxis& axis = upright ? plot.y : plot.x;
  Scale scale;
  scale.log = axis.log;
  std::vector<double> reached;
  const auto reach = [&](const std::vector<double>& values) {
    std::copy_if(values.begin(), values.end(), std::back_inserter(reached), [&](double v) { return scale.shows(v); });
  };
  for (const PlotSeries& s : plot.series) {
    reach(upright ? s.y : s.x);
    if (upright) reach(s.low), reach(s.high);
    if (upright && s.kind == PlotSeries::Kind::kBars) reach({0});
  }
  for (const PlotGuide& g : plot.guides) {
    if (g.upright == !upright) reach({g.at});
  }
  if (reached.empty()) reached = {axis.log ? 0.1 : 0, 1};
  const auto [least, most] = std::minmax_element(reached.begin(), reached.end());
  std::tie(scale.low, scale.high) = axis.range.value_or(std::pair(*least, *most));
  if (axis.range) return scale;
  if (axis.log) {  // Whole decades would waste room.
    scale.low = roundedDown(scale.low);
    scale.high = std::max(2.5 * roundedDown(scale.high), 10 * scale.low);
  } else if (scale.high - scale.low <= 1e-3 * std::abs(scale.high)) {
    // What stands still is not looked at under a lens.
    const double flat = std::max(1e-9, scale.high == 0 ? 1 : 0.1 * std::abs(scale.high));
    scale.low -= upright ? flat : 0;
    scale.high += flat;
  } else if (upright) {
    const double margin = 0.05 * (scale.high - scale.low);
    scale.low -= scale.low == 0 ? 0 : margin;
    scale.high += margin;
  }
  return scale;
}

std::vector<std::pair<double, std::string>> ticksOf(const PlotAxis& axis, const Scale& scale, int about) {
  if (axis.ticks) return *axis.ticks;
  std::vector<std::pair<double, std::string>> ticks;
  const auto add = [&](double value) {
    ticks.emplace_back(value, formatted("%.4g", std::abs(value) < 1e-12 ? 0.0 : value));
  };
  if (scale.log) {
    const bool wide = scale.high > 200 * scale.low;
    const int first = static_cast<int>(std::floor(std::log10(scale.low)));
    const int last = static_cast<int>(std::ceil(std::log10(scale.high)));
    for (int e = first; e <= last; e += 1 + (last - first) / 10) {
      for (const int digit : {1, 2, 5}) {
        const double v = digit * std::pow(10, e);
        if ((digit == 1 || !wide) && v >= scale.low * 0.999 && v <= scale.high * 1.001) add(v);
      }
    }
    return ticks;
  }
  const double raw = (scale.high - scale.low) / about, decade = std::pow(10, std::floor(std::log10(raw)));
  const double step = decade * (raw / decade < 1.5 ? 1 : raw / decade < 3.5 ? 2 : raw / decade < 7.5 ? 5 : 10);
  const double first = std::ceil(scale.low / step - 1e-9);
  for (int k = 0; k <= 2 * about + 1 && (first + k) * step <= scale.high + 1e-9 * step; ++k) add((first + k) * step);
  return ticks;
}

}  // namespace angio::plotting
