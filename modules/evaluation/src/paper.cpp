// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/paper.hpp"

#include <algorithm>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/evaluation/simulation_report.hpp"
#include "angio/evaluation/statistics.hpp"

namespace angio::evaluation {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kGrossFailure_px = 5;

// Table I as printed; no time where it prints none.
struct PrintedRow {
  const char* name;
  double gfr_percent, mean_pr_mm, p95_pr_mm, p75_pr_mm;
  std::optional<double> time_ms;
};
const std::vector<PrintedRow>& printedTable1() {
  static const std::vector<PrintedRow> kRows = {{"AutoMask", 0, 0.85, 1.50, 1.06, 97004},
                                                {"Pair-wise DNN", 0, 1.74, 2.54, 2.02, 311.3},
                                                {"RGRB", 22, 2.21, 3.92, 1.71, {}},
                                                {"DT-ICP, rigid", 54, 1.80, 6.65, 3.49, 13.2},
                                                {"DT-ICP", 0, 0.42, 0.72, 0.42, 39.4},
                                                {"NICP", 8, 0.50, 3.11, 1.14, 385},
                                                {"Iterative PnP, rigid", 4, 0.39, 0.84, 0.56, 16.9},
                                                {"Iterative PnP, nonrigid", 0, 0.37, 0.69, 0.44, 45.5}};
  return kRows;
}

// Fewest digits that tell small errors from none.
std::string small(double value) { return formatted(value != 0 && value < 0.01 ? "%.4f" : "%.2f", value); }

// The last cells of a row: pose errors and how many poses are right.
std::string poseCells(const PaperFigures& f) {
  return small(f.rotation_deg) + " deg, " + small(f.centroid_mm) + " mm | " + small(f.median_rotation_deg) + " deg, " +
         small(f.median_centroid_mm) + formatted(" mm | %.0f %% |\n", f.pose_ok_percent);
}

// One figure over the spread of the starts, the paper's and each method's.
std::string figureOver(const std::vector<PaperLevel>& levels, const std::string& title, const std::string& unit,
                       double (*theirs)(const PaperStart&), double (*ours)(const PaperFigures&)) {
  Plot plot;
  plot.x.label = "spread of the starts per axis";
  plot.y.label = unit;
  plot.x.ticks.emplace();
  std::vector<PlotSeries> methods;
  PlotSeries paper{"the paper", {}, {}, 4};
  for (const auto& level : levels) {
    const double x = level.start.translation_std_mm;
    plot.x.ticks->emplace_back(x, formatValue(level.start.rotation_std_deg) + "\u00b0, " + formatValue(x) + " mm");
    paper.x.push_back(x);
    paper.y.push_back(theirs(level.start));
    for (std::size_t m = 0; m < level.runs.size(); ++m) {
      if (methods.size() <= m) methods.push_back({level.runs[m].name, {}, {}, m < 4 ? static_cast<int>(m) : 5});
      methods[m].x.push_back(x);
      methods[m].y.push_back(ours(paperFigures(level.runs[m])));
    }
  }
  plot.series.push_back(paper);
  plot.series.insert(plot.series.end(), methods.begin(), methods.end());
  // Room at both ends for the names below.
  plot.x.range = {0, levels.empty() ? 1 : 1.08 * levels.back().start.translation_std_mm};
  plot.y.range = {0, 1};
  for (const auto& s : plot.series) {
    for (const double y : s.y) plot.y.range->second = std::max(plot.y.range->second, 1.05 * y);
  }
  return html::figure(title, plot);
}

Json figuresAsJson(const PaperFigures& f) {
  return {{"gfr_percent", f.gfr_percent},
          {"mean_pr_mm", f.mean_pr_mm},
          {"p75_pr_mm", f.p75_pr_mm},
          {"p95_pr_mm", f.p95_pr_mm},
          {"mean_rotation_deg", f.rotation_deg},
          {"mean_centroid_mm", f.centroid_mm},
          {"median_rotation_deg", f.median_rotation_deg},
          {"median_centroid_mm", f.median_centroid_mm},
          {"pose_ok_percent", f.pose_ok_percent},
          {"time_ms", f.time_ms}};
}

}  // namespace

const std::vector<PaperStart>& paperStarts() {
  static const std::vector<PaperStart> kStarts = {{0.5, 1, 0.10, 0, 0.10, 1.81},
                                                  {1, 3, 0.28, 0, 0.29, 5.31},
                                                  {2, 5, 0.43, 0, 0.46, 7.09},
                                                  {3, 8, 0.82, 0, 0.68, 12.48},
                                                  {5, 10, 1.51, 21, 3.40, 14.98}};
  return kStarts;
}

const PaperStart& paperTable1Start() { return paperStarts()[2]; }

SimulationSettings paperProtocol(const PaperStart& start, int trials, int seed) {
  SimulationSettings s;
  s.trials = trials;
  s.seed = seed;
  s.rotation_std_deg = start.rotation_std_deg;
  s.translation_std_mm = start.translation_std_mm;
  s.spacing_px = 0;
  s.tree_spacing_mm = 0;
  return s;
}

PaperFigures paperFigures(const EntrantRun& run) {
  PaperFigures f;
  f.name = run.name;
  std::vector<double> pr_mm, rotation_deg, centroid_mm, time_ms;
  const double share = run.outcomes.empty() ? 0.0 : 100.0 / static_cast<double>(run.outcomes.size());
  for (const auto& o : run.outcomes) {
    const double pr_px = o.result.agreement.model_rms_px;
    // A trial without an answer has no residual: a failure, whatever the field says.
    const bool none = o.result.status == RegistrationStatus::kTooFewPoints;
    f.gfr_percent += none || !(pr_px <= kGrossFailure_px) ? share : 0.0;
    if (!none) pr_mm.push_back(kPaperPixel_mm * pr_px);
    rotation_deg.push_back(radToDeg(o.error->rotation_rad));
    centroid_mm.push_back(1e3 * o.error->centroid_m);
    f.pose_ok_percent += rotation_deg.back() < 0.1 && centroid_mm.back() < 1 ? share : 0.0;
    time_ms.push_back(1e3 * (o.image_s + o.result.times.total_s));
  }
  f.mean_pr_mm = mean(pr_mm);
  f.p75_pr_mm = percentile(pr_mm, 0.75);
  f.p95_pr_mm = percentile(pr_mm, 0.95);
  f.rotation_deg = mean(rotation_deg);
  f.centroid_mm = mean(centroid_mm);
  f.median_rotation_deg = percentile(rotation_deg, 0.5);
  f.median_centroid_mm = percentile(centroid_mm, 0.5);
  f.time_ms = percentile(time_ms, 0.5);
  return f;
}

std::string paperTable1(const std::vector<EntrantRun>& runs) {
  std::string table =
      "Table I: starts off by 2 deg and 5 mm (standard deviation per axis), noise-free\n\n"
      "| method | GFR, PR > 5 px | mean PR [mm] | 95 % | 75 % | ms | pose error, mean | median | pose ok |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
  for (const auto& row : printedTable1()) {
    table += formatted("| paper: %s | %.0f %% | %.2f | %.2f | %.2f | %s | %s | - | - |\n", row.name, row.gfr_percent,
                       row.mean_pr_mm, row.p95_pr_mm, row.p75_pr_mm,
                       row.time_ms ? formatted("%.1f", *row.time_ms).c_str() : "-",
                       std::string(row.name) == "Iterative PnP, rigid" ? "0.46 deg, 7.09 mm" : "-");
  }
  for (const auto& run : runs) {
    const PaperFigures f = paperFigures(run);
    table += "| " + f.name + formatted(" | %.0f %% | ", f.gfr_percent) + small(f.mean_pr_mm) + " | " +
             small(f.p95_pr_mm) + " | " + small(f.p75_pr_mm) + formatted(" | %.1f | ", f.time_ms) + poseCells(f);
  }
  return table +
         "PR: rms distance to the nearest image point, 1 px = 0.30 mm as in the paper; it is small for a wrong pose, "
         "too. Pose error: at the tree's centroid. Pose ok: within 0.1 deg and 1 mm. The paper's times are those of "
         "its own machines.\n";
}

std::string paperTable3(const std::vector<PaperLevel>& levels) {
  std::string table =
      "Table III: what the spread of the starts leaves\n\n"
      "| start, std per axis | method | mean PR [mm] | GFR, PR > 5 px | pose error left, mean | median | pose ok |\n"
      "| --- | --- | --- | --- | --- | --- | --- |\n";
  for (const auto& level : levels) {
    const PaperStart& p = level.start;
    const std::string start = formatted("%g deg, %g mm", p.rotation_std_deg, p.translation_std_mm);
    table += "| " + start +
             formatted(" | paper: Iterative PnP | %.2f | %.0f %% | %.2f deg, %.2f mm | - | - |\n", p.mean_pr_mm,
                       p.gfr_percent, p.rotation_deg, p.translation_mm);
    for (const auto& run : level.runs) {
      const PaperFigures f = paperFigures(run);
      table += "| " + start + " | " + f.name + " | " + small(f.mean_pr_mm) + formatted(" | %.0f %% | ", f.gfr_percent) +
               poseCells(f);
    }
  }
  return table;
}

Json paperAsJson(const std::vector<EntrantRun>& table1, const std::vector<PaperLevel>& table3) {
  Json json;
  for (const auto& row : printedTable1()) {
    json["table1"]["paper"][row.name] = {{"gfr_percent", row.gfr_percent},
                                         {"mean_pr_mm", row.mean_pr_mm},
                                         {"p95_pr_mm", row.p95_pr_mm},
                                         {"p75_pr_mm", row.p75_pr_mm},
                                         {"time_ms", row.time_ms ? Json(*row.time_ms) : Json(nullptr)}};
  }
  for (const auto& run : table1) json["table1"]["here"][run.name] = figuresAsJson(paperFigures(run));
  for (const auto& level : table3) {
    const PaperStart& p = level.start;
    Json entry = {{"rotation_std_deg", p.rotation_std_deg}, {"translation_std_mm", p.translation_std_mm}};
    entry["paper"] = {{"mean_pr_mm", p.mean_pr_mm},
                      {"gfr_percent", p.gfr_percent},
                      {"mean_rotation_deg", p.rotation_deg},
                      {"mean_centroid_mm", p.translation_mm}};
    for (const auto& run : level.runs) entry["here"][run.name] = figuresAsJson(paperFigures(run));
    json["table3"].push_back(entry);
  }
  return json;
}

std::string paperReportHtml(const std::vector<EntrantRun>& table1, const std::vector<PaperLevel>& table3,
                            const std::string& tree_name, const Json& settings_shown) {
  const auto size = table1.empty() ? 0 : table1.front().outcomes.size();
  std::string settings;
  for (const auto& [name, values] : settings_shown.items()) settings += html::details(name, values);
  return html::page(
      "Beside the paper",
      "Its simulation experiments on " + tree_name + ", " + std::to_string(size) +
          " trials per row, noise-free, one image point per point of the tree, another view in every trial. The "
          "paper's "
          "tree, views and the unit of lengths in its prior are not known. " +
          html::machineLine(),
      {html::section("Table I", html::fromMarkdown(paperTable1(table1))),
       html::section("The same, trial by trial",
                     html::grid({html::errorFigure(table1), html::timeFigure(table1), html::startAndEndFigure(table1),
                                 html::captureFigure(table1)})),
       html::section(
           "Table III",
           html::grid(
               {figureOver(
                    table3, "Projection residual", "mean PR [mm]", [](const PaperStart& p) { return p.mean_pr_mm; },
                    [](const PaperFigures& f) { return f.mean_pr_mm; }),
                figureOver(
                    table3, "Gross failures", "GFR, PR > 5 px [%]", [](const PaperStart& p) { return p.gfr_percent; },
                    [](const PaperFigures& f) { return f.gfr_percent; }),
                figureOver(
                    table3, "Rotation left", "mean [deg]", [](const PaperStart& p) { return p.rotation_deg; },
                    [](const PaperFigures& f) { return f.rotation_deg; }),
                figureOver(
                    table3, "Translation left", "mean [mm]", [](const PaperStart& p) { return p.translation_mm; },
                    [](const PaperFigures& f) { return f.centroid_mm; })}) +
               html::fromMarkdown(paperTable3(table3))),
       html::section("Settings and machine", settings + html::details("machine", machineAsJson()))});
}

}  // namespace angio::evaluation
