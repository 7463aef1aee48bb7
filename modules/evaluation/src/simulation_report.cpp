// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/simulation_report.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/results/experiment.hpp"
#include "angio/results/overlay.hpp"

namespace angio::evaluation {
namespace html {
namespace {

// What cannot be told apart from a perfect answer on a log axis [mm].
constexpr double kMinShown_mm = 1e-5;

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
  return std::isfinite(mm) ? std::clamp(mm, kMinShown_mm, 1e4) : 1e4;
}

}  // namespace

std::string captureFigure(const std::vector<EntrantRun>& runs) {
  Plot plot{"",
            {"start: mTRE [mm], bins of 1 mm", false, std::pair(0, CaptureBins::kBins)},
            {"success (mTRE < 2 mm) [%]", false, std::pair(0, 103)}};
  plot.guides.push_back({95, "95 %"});
  for (std::size_t m = 0; m < runs.size(); ++m) {
    const CaptureBins bins = captureBins(runs[m].outcomes);
    PlotSeries s{runs[m].name, {}, {}, static_cast<int>(m)};
    for (int b = 0; b < CaptureBins::kBins; ++b) {
      const int trials = bins.trials[b], good = bins.successes[b];
      if (m == 0) plot.counts.emplace_back(b + 0.5, trials);
      if (trials < CaptureBins::kMinTrials) continue;
      const ShareBounds bounds = shareBounds(good, trials);
      s.x.push_back(b + 0.5);
      s.y.push_back(100.0 * good / trials);
      s.low.push_back(100 * bounds.low);
      s.high.push_back(100 * bounds.high);
    }
    plot.series.push_back(s);
  }
  return figure("Capture range", plot,
                "Bands: 95 % confidence (Wilson). Bins with fewer than " + std::to_string(CaptureBins::kMinTrials) +
                    " trials are left out; the bars below are the number of trials.");
}

std::string errorFigure(const std::vector<EntrantRun>& runs) {
  Plot plot = cumulativePlot(runs, "mTRE at the end [mm]", shownError_mm);
  plot.guides.push_back({1e3 * kSuccessMtre_m, "2 mm", true});
  return figure("Error at the end", plot, "The share of trials that end nearer to the truth than this.");
}

std::string startAndEndFigure(const std::vector<EntrantRun>& runs) {
  Plot plot{"", {"mTRE at the start [mm]"}, {"mTRE at the end [mm]", true}};
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

std::string sweepFigure(const Json& swept) {
  Plot plot{"", {swept["quantity"].get<std::string>()}, {"success (mTRE < 2 mm) [%]", false, std::pair(0, 103)}};
  plot.guides.push_back({95, "95 %"});
  plot.x.ticks.emplace();
  for (const Json& point : swept["points"]) {
    const double x = point["value"];
    plot.x.ticks->emplace_back(x, formatValue(x));
    std::size_t m = 0;
    for (const auto& [method, summary] : point["summaries"].items()) {
      if (plot.series.size() <= m) {
        plot.series.push_back({method, {}, {}, static_cast<int>(m / 2)});
        plot.series.push_back({"", {}, {}, static_cast<int>(m / 2)});  // Without a name: the legend says it for all.
        plot.series.back().dashed = true;
      }
      PlotSeries &success = plot.series[m++], &in_plane = plot.series[m++];
      success.x.push_back(x);
      success.y.push_back(summary["success_mtre_2mm_percent"]);
      success.low.push_back(summary["success_mtre_2mm_bounds_percent"][0]);
      success.high.push_back(summary["success_mtre_2mm_bounds_percent"][1]);
      in_plane.x.push_back(x);
      in_plane.y.push_back(summary["in_plane_below_2mm_percent"]);
    }
  }
  return figure("Over " + swept["name"].get<std::string>(), plot);
}

std::string machineLine(const Json& m) {
  if (m.is_null()) return "";
  return m.value("processor", "unknown processor") + ", " + std::to_string(m.value("cores", 0)) + " cores, compiler " +
         m.value("compiler", "") + ", one thread.";
}

std::string settingsSection(const Json& settings_shown, const Json& machine) {
  std::string settings;
  for (const auto& [name, values] : settings_shown.items()) settings += details(name, values);
  if (machine.is_null()) return section("Settings", settings);
  return section("Settings and machine", settings + details("machine", machine));
}

}  // namespace html

namespace {

constexpr int kDrawnWidth_px = 1024, kPictureWidth_px = 640;

std::string cards(const Json& summaries) {
  std::vector<std::string> cards;
  int color = 0;
  for (const auto& [method, s] : summaries.items()) {
    std::vector<std::string> lines;
    for (const char* line :
         {"success, mTRE < 2 mm ({success_mtre_2mm_bounds_percent/0:%.0f} to "
          "{success_mtre_2mm_bounds_percent/1:%.0f %%})",
          "{failed_and_trusted_percent:%.0f %%} failed and trusted", "{mtre_mm/median:%.3f mm} median mTRE",
          "{time_ms/total/p50:%.1f ms} median, {time_ms/total/p99:%.1f ms} p99"}) {
      lines.push_back(filled(line, s));
    }
    cards.push_back(html::card(method, filled("{success_mtre_2mm_percent:%.0f %%}", s), lines, color++));
  }
  return html::grid(cards, true);
}

// The same view on a finer detector: lines and letters stay fine in a small field of view.
XrayCamera enlarged(const XrayCamera& camera, double factor) {
  XrayCamera::Parameters p = camera.parameters();
  p.width_px = static_cast<int>(std::lround(factor * p.width_px));
  p.height_px = static_cast<int>(std::lround(factor * p.height_px));
  p.fx_px *= factor;
  p.fy_px *= factor;
  p.cx_px *= factor;
  p.cy_px *= factor;
  return XrayCamera(p);
}

std::string pictureOf(const SimulationReport& r, const EntrantRun& run, std::size_t which, const std::string& name) {
  const VesselTree& tree = r.setup.trees[which % r.setup.trees.size()];
  const CaseOutcome& outcome = run.outcomes[which];
  const SimulatedTrial trial = simulatedTrial(tree, r.setup.camera, r.settings, static_cast<int>(which));
  const double factor = static_cast<double>(kDrawnWidth_px) / trial.cameras.front().width_px();
  Centerline2d seen = trial.centerlines.front();
  seen.points_px *= factor;
  if (const auto shown = outcome.result.displacements_m.cols(); shown != 0 && shown != tree.size()) {
    throw InputError("trial " + outcome.name, "displacements_m", std::to_string(shown), "must be one for each point");
  }
  OverlayScene scene;
  scene.centerline = &seen;
  scene.trees.push_back({trial.start, {}, kStartColor, "start"});
  const StatusStyle style = statusStyle(outcome.result.status);
  scene.trees.push_back(
      {outcome.result.T_camera_model, outcome.result.displacements_m, style.color_bgr, "registered: " + style.words});
  const cv::Mat drawn = drawOverlay(scene, tree, enlarged(trial.cameras.front(), factor));
  cv::Mat small;
  const double scale = static_cast<double>(kPictureWidth_px) / drawn.cols;
  cv::resize(drawn, small, {}, scale, scale, cv::INTER_AREA);
  return html::picture(
      small, name + ": trial " + outcome.name + formatted(", from %.1f mm", 1e3 * outcome.start_error->mtre_m) +
                 formatted(" to %.3f mm mTRE, ", 1e3 * outcome.error->mtre_m) + statusName(outcome.result.status));
}

// The best, the median and the worst trial of one method.
std::string pictures(const SimulationReport& r, const EntrantRun& run) {
  std::vector<std::size_t> order(run.outcomes.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    const double ea = run.outcomes[a].error->mtre_m, eb = run.outcomes[b].error->mtre_m;
    return !std::isnan(ea) && (std::isnan(eb) || ea < eb);
  });
  if (order.empty()) return "";
  return "<h3>" + htmlEscaped(run.name) + "</h3>\n" +
         html::grid({pictureOf(r, run, order.front(), "Best"), pictureOf(r, run, order[order.size() / 2], "Median"),
                     pictureOf(r, run, order.back(), "Worst")},
                    true);
}

std::string subtitle(const SimulationReport& r) {
  std::string trees;
  for (const auto& name : r.tree_names) trees += (trees.empty() ? "" : ", ") + name;
  return std::to_string(r.settings.trials) + " trials on " + trees +
         formatted(", starts off by %g deg", r.settings.rotation_std_deg) +
         formatted(" and %g mm per axis", r.settings.translation_std_mm) +
         (r.settings.even_starts_mm > 0 ? formatted(", scaled to 0 to %g mm mTRE", r.settings.even_starts_mm) : "") +
         (r.settings.views == 2 ? ", two views. " : ", one view. ") + html::machineLine(r.machine);
}

}  // namespace

std::string simulationReportHtml(const SimulationReport& r) {
  std::vector<std::string> sections;
  sections.push_back(html::section("At a glance", cards(r.summaries)));
  std::vector<std::string> curves = {html::captureFigure(r.runs), html::startAndEndFigure(r.runs),
                                     html::errorFigure(r.runs)};
  if (!r.machine.is_null()) curves.push_back(html::timeFigure(r.runs));
  sections.push_back(html::section("From start to end", html::grid(curves)));
  if (!r.sweeps.empty()) {
    std::vector<std::string> figures;
    for (const auto& sweep : r.sweeps) figures.push_back(html::sweepFigure(sweep));
    sections.push_back(html::section(
        "Sweeps", html::paragraph("One quantity at a time; everything else as in the "
                                  "settings below. Bands: 95 % confidence. Broken lines: the share with less "
                                  "than 2 mm across the beam, whatever the depth.") +
                      html::grid(figures)));
  }
  std::string shown = html::paragraph(
      "Broad red: the centreline in the image. Blue: the tree at its start. Green: the tree as registered.");
  for (const auto& run : r.runs) shown += pictures(r, run);
  sections.push_back(html::section("Best, median, worst", shown));
  sections.push_back(html::section("All figures", html::fromMarkdown(simulationTable(r.summaries))));
  if (!r.sweeps.empty()) {
    std::string tables;
    for (const auto& sweep : r.sweeps) tables += html::fromMarkdown(sweepTable(sweep));
    sections.push_back(html::section("Sweeps in figures", tables));
  }
  sections.push_back(html::settingsSection(r.settings_shown, r.machine));
  return html::page("Registration in simulation", subtitle(r), sections);
}

}  // namespace angio::evaluation
