// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/calibration/namespace.hpp"
#include "angio/evaluation/plot.hpp"

namespace angio::calibration {

/// Named values of views or poses as bars beside each other; those that were left out are red.
struct BarChart {
  Plot plot;

  BarChart(const std::string& title, const std::string& unit, int color = 0) : plot{title, {}, {unit}} {
    plot.x.ticks.emplace();
    constexpr auto kBars = PlotSeries::Kind::kBars;
    plot.series = {{"", {}, {}, color, kBars}, {"", {}, {}, kWarningColor, kBars}};
  }

  void add(const std::string& name, double value, bool left_out) {
    const auto at = static_cast<double>(plot.x.ticks->size());
    plot.x.ticks->emplace_back(at, name);
    plot.x.range = {-0.6, at + 0.6};
    plot.series[left_out ? 1 : 0].x.push_back(at);
    plot.series[left_out ? 1 : 0].y.push_back(value);
  }
};

}  // namespace angio::calibration
