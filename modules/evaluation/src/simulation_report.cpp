// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/simulation_report.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/base/formatted.hpp"
#include "angio/evaluation/overlay.hpp"
#include "angio/evaluation/tables.hpp"

namespace angio::evaluation {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kDrawnWidth_px = 1024, kPictureWidth_px = 640;

std::string cards(const Json& summaries) {
  std::vector<std::string> cards;
  int color = 0;
  for (const auto& [method, s] : summaries.items()) {
    cards.push_back(html::card(method, figureOf(s, "success_mtre_2mm_percent", "%.0f %%"),
                               {"success, mTRE < 2 mm (" + figureOf(s, "success_mtre_2mm_bounds_percent/0", "%.0f") +
                                    " to " + figureOf(s, "success_mtre_2mm_bounds_percent/1", "%.0f %%") + ")",
                                figureOf(s, "failed_and_trusted_percent", "%.0f %%") + " failed and trusted",
                                figureOf(s, "mtre_mm/median", "%.3f mm") + " median mTRE",
                                figureOf(s, "time_ms/total/p50", "%.1f ms") + " median, " +
                                    figureOf(s, "time_ms/total/p99", "%.1f ms") + " p99"},
                               color++));
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
  OverlayScene scene;
  scene.centerline = &seen;
  scene.trees.push_back({trial.start, {}, kStartColor, "start"});
  scene.trees.push_back({outcome.result.T_camera_model, outcome.result.displacements_m, kModelColor, "registered"});
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
         (r.settings.views == 2 ? ", two views. " : ", one view. ") + html::machineLine();
}

}  // namespace

namespace html {

std::string machineLine() {
  const Json m = machineAsJson();
  return m.value("processor", "unknown processor") + ", " + std::to_string(m.value("cores", 0)) + " cores, compiler " +
         m.value("compiler", "") + ", one thread.";
}

}  // namespace html

std::string simulationReportHtml(const SimulationReport& r) {
  std::vector<std::string> sections;
  sections.push_back(html::section("At a glance", cards(r.summaries)));
  sections.push_back(
      html::section("From start to end", html::grid({html::captureFigure(r.runs), html::startAndEndFigure(r.runs),
                                                     html::errorFigure(r.runs), html::timeFigure(r.runs)})));
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
  std::string settings;
  for (const auto& [name, values] : r.settings_shown.items()) settings += html::details(name, values);
  sections.push_back(html::section("Settings and machine", settings + html::details("machine", machineAsJson())));
  return html::page("Registration in simulation", subtitle(r), sections);
}

}  // namespace angio::evaluation
