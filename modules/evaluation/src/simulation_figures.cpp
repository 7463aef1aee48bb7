// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/evaluation/simulation_report.hpp"

namespace angio::evaluation::html {
namespace {

// What cannot be told apart from a perfect answer on a log axis [mm].
constexpr double kSmallestShown_mm = 1e-5;

// For each run the share of its trials with less than each value, in percent.
template <typename Value>
Plot cumulativePlot(const std::vector<EntrantRun>& runs, const std::string& x_label, const Value& value) {
  Plot plot{"", {x_label, true}, {"trials with less [%]", false, std::pair(0, 103)}};
  for (std::size_t m = 0; m < runs.size(); ++m) {
    PlotSeries s{runs[m].name, {}, {}, static_cast<int>(m), PlotSeries::Kind::kSteps};
    for (const CaseOutcome& o : runs[m].outcomes) s.x.push_back(value(o));
    std::sort(s.x.begin(), s.x.end());
    for (std::size_t i = 0; i < s.x.size(); ++i) {
      s.y.push_back(100.0 * static_cast<double>(i + 1) / static_cast<double>(s.x.size()));
    }
    plot.series.push_back(s);
  }
  return plot;
}

double shownError_mm(const CaseOutcome& o) {
  const double mm = 1e3 * o.error->mtre_m;
  return std::isfinite(mm) ? std::clamp(mm, kSmallestShown_mm, 1e4) : 1e4;
}

}  // namespace

std::string captureFigure(const std::vector<EntrantRun>& runs) {
  Plot plot;
  plot.x.label = "start: mTRE [mm], bins of 1 mm";
  plot.y.label = "success (mTRE < 2 mm) [%]";
  plot.x.range = {0, CaptureBins::kBins};
  plot.y.range = {0, 103};
  plot.guides.push_back({95, "95 %"});
  for (std::size_t m = 0; m < runs.size(); ++m) {
    const CaptureBins bins = captureBins(runs[m].outcomes);
    PlotSeries s{runs[m].name, {}, {}, static_cast<int>(m)};
    for (int b = 0; b < CaptureBins::kBins; ++b) {
      const int trials = bins.trials[static_cast<std::size_t>(b)], good = bins.successes[static_cast<std::size_t>(b)];
      if (m == 0) plot.counts.emplace_back(b + 0.5, trials);
      if (trials < CaptureBins::kFewestTrials) continue;
      const ShareBounds bounds = shareBounds(good, trials);
      s.x.push_back(b + 0.5);
      s.y.push_back(100.0 * good / trials);
      s.low.push_back(100 * bounds.low);
      s.high.push_back(100 * bounds.high);
    }
    plot.series.push_back(s);
  }
  return figure("Capture range", plot,
                "Bands: 95 % confidence (Wilson). Bins with fewer than " + std::to_string(CaptureBins::kFewestTrials) +
                    " trials are left out; the bars below are the number of trials.");
}

std::string errorFigure(const std::vector<EntrantRun>& runs) {
  Plot plot = cumulativePlot(runs, "mTRE at the end [mm]", shownError_mm);
  plot.guides.push_back({1e3 * kSuccessMtre_m, "2 mm", true});
  return figure("Error at the end", plot, "The share of trials that end nearer to the truth than this.");
}

std::string startAndEndFigure(const std::vector<EntrantRun>& runs) {
  Plot plot;
  plot.x.label = "mTRE at the start [mm]";
  plot.y.label = "mTRE at the end [mm]";
  plot.y.log = true;
  plot.guides.push_back({1e3 * kSuccessMtre_m, "2 mm"});
  double farthest_mm = 1;
  for (std::size_t m = 0; m < runs.size(); ++m) {
    PlotSeries s{runs[m].name, {}, {}, static_cast<int>(m), PlotSeries::Kind::kDots};
    for (const auto& o : runs[m].outcomes) {
      s.x.push_back(1e3 * o.start_error->mtre_m);
      s.y.push_back(shownError_mm(o));
      s.hollow.push_back(o.result.status != RegistrationStatus::kConverged);
      farthest_mm = std::max(farthest_mm, s.x.back());
    }
    plot.series.push_back(s);
  }
  plot.x.range = {0, std::ceil(farthest_mm)};
  return figure("Trial by trial", plot,
                "Filled: the method trusts its answer (converged). Ring: it says that something is wrong. A filled dot "
                "above the line is a failure that nobody notices.");
}

std::string timeFigure(const std::vector<EntrantRun>& runs) {
  const auto time_ms = [](const CaseOutcome& o) { return 1e3 * (o.image_s + o.result.times.total_s); };
  return figure("Time", cumulativePlot(runs, "time of one registration [ms]", time_ms),
                "Wall time from centrelines to pose, one thread; methods took turns on the same trials.");
}

std::string sweepFigure(const SweepResult& result) {
  Plot plot;
  plot.x.label = result.sweep.axis;
  plot.y.label = "success (mTRE < 2 mm) [%]";
  plot.y.range = {0, 103};
  plot.guides.push_back({95, "95 %"});
  plot.x.ticks.emplace();
  for (const auto& point : result.sweep.points) plot.x.ticks->emplace_back(point.value, formatValue(point.value));
  if (result.summaries.empty()) return figure(result.sweep.name, plot);
  int color = 0;
  for (const auto& [method, unused] : result.summaries.front().items()) {
    PlotSeries s{method, {}, {}, color};
    PlotSeries in_plane{"", {}, {}, color++};  // Without a name: the legend says it once for all.
    in_plane.dashed = true;
    for (std::size_t i = 0; i < result.summaries.size(); ++i) {
      const auto& summary = result.summaries[i][method];
      s.x.push_back(result.sweep.points[i].value);
      s.y.push_back(summary["success_mtre_2mm_percent"]);
      in_plane.x.push_back(result.sweep.points[i].value);
      in_plane.y.push_back(summary["in_plane_below_2mm_percent"]);
      s.low.push_back(summary["success_mtre_2mm_bounds_percent"][0]);
      s.high.push_back(summary["success_mtre_2mm_bounds_percent"][1]);
    }
    plot.series.push_back(s);
    plot.series.push_back(in_plane);
  }
  return figure("Over " + result.sweep.name, plot);
}

}  // namespace angio::evaluation::html
