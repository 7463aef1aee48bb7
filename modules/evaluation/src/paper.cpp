// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/paper.hpp"

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>
#include <nlohmann/json.hpp>

#include "angio/base/formatted.hpp"
#include "angio/evaluation/paper_real.hpp"
#include "angio/evaluation/point_sets.hpp"
#include "angio/evaluation/simulation_report.hpp"
#include "angio/results/columns.hpp"
#include "angio/results/experiment.hpp"

namespace angio::evaluation {
namespace {

constexpr double kGrossFailure_px = 5;

// Table I as printed; no time where it prints none.
struct PrintedRow {
  const char* name;
  double gfr_percent, mean_pr_mm, p95_pr_mm, p75_pr_mm;
  std::optional<double> time_ms;
};
constexpr PrintedRow kPrintedTable1[] = {{"AutoMask", 0, 0.85, 1.50, 1.06, 97004},
                                         {"Pair-wise DNN", 0, 1.74, 2.54, 2.02, 311.3},
                                         {"RGRB", 22, 2.21, 3.92, 1.71, {}},
                                         {"DT-ICP, rigid", 54, 1.80, 6.65, 3.49, 13.2},
                                         {"DT-ICP", 0, 0.42, 0.72, 0.42, 39.4},
                                         {"NICP", 8, 0.50, 3.11, 1.14, 385},
                                         {"Iterative PnP, rigid", 4, 0.39, 0.84, 0.56, 16.9},
                                         {"Iterative PnP, nonrigid", 0, 0.37, 0.69, 0.44, 45.5}};

// Fewest digits that tell small errors from none.
std::string small(double value) { return formatted(value != 0 && value < 0.01 ? "%.4f" : "%.2f", value); }

// The last cells of a row: pose errors and how many poses are right.
std::string poseCells(const Json& f) {
  const auto cell = [&](const std::string& which) {
    return small(f[which + "_rotation_deg"]) + " deg, " + small(f[which + "_centroid_mm"]) + " / " +
           small(f[which + "_source_mm"]) + " mm | ";
  };
  return cell("mean") + cell("median") + filled("{pose_ok_percent:%.0f %%} |\n", f);
}

// Figures show the rigid half: there are colours for six lines, and the tables have all.
bool isDrawn(const std::string& name) {
  const std::string left_out = ", nonrigid";
  return name.size() < left_out.size() || name.compare(name.size() - left_out.size(), left_out.size(), left_out) != 0;
}

// One figure over the spread of the starts, the paper's and each method's.
std::string figureOver(const Json& levels, const std::string& title, const std::string& unit, const char* key) {
  // Room at both ends for the names below.
  Plot plot{"", {"spread of the starts per axis", false, std::pair(0, 1)}, {unit, false, std::pair(0, 1)}};
  plot.x.ticks.emplace();
  const bool printed = !levels.empty() && levels.front()["paper"].contains(key);
  plot.series.push_back({printed ? "the paper" : "", {}, {}, 4});
  for (const Json& level : levels) {
    const double x = level["translation_std_mm"];
    plot.x.ticks->emplace_back(x, filled("{rotation_std_deg:%g}\u00b0, {translation_std_mm:%g} mm", level));
    plot.x.range->second = 1.08 * x;
    const auto add = [&](std::size_t s, const Json& figures) {
      plot.series[s].x.push_back(x);
      plot.series[s].y.push_back(figures[key]);
      plot.y.range->second = std::max(plot.y.range->second, 1.05 * plot.series[s].y.back());
    };
    if (printed) add(0, level["paper"]);
    std::size_t s = 0;
    for (const auto& [name, figures] : level["here"].items()) {
      if (!isDrawn(name)) continue;
      if (plot.series.size() <= ++s) plot.series.push_back({name, {}, {}, s < 5 ? static_cast<int>(s) - 1 : 5});
      add(s, figures);
    }
  }
  return html::figure(title, plot);
}

// The losses of a match's distance that the paper compares, at the last scale of the kernel and our limit of Huber's.
std::string lossFigure() {
  const IterativePnpSettings paper = IterativePnpSettings::asInThePaper();
  Plot plot{"", {"distance of a match [px]", false, std::pair(0, 10)}, {"loss", false, std::pair(0, 12)}};
  PlotSeries kernel{"kernel, scale 1 px", {}, {}, 0}, wide{"kernel, scale 4 px", {}, {}, 5},
      huber{formatted("Huber, %g px", paper.huber_px), {}, {}, 1}, squares{"squares", {}, {}, 2};
  for (double d = 0; d <= 10; d += 0.1) {
    const auto add = [&](PlotSeries& series, double loss) {
      if (loss > plot.y.range->second) return;
      series.x.push_back(d);
      series.y.push_back(loss);
      series.marked = false;
    };
    const double h = paper.huber_px;
    add(kernel, 1 - std::exp(-d * d / 2));
    add(wide, 16 * (1 - std::exp(-d * d / (2 * 16))));
    add(huber, d <= h ? d * d / 2 : h * (d - h / 2));
    add(squares, d * d / 2);
  }
  plot.series = {kernel, wide, huber, squares};
  return html::figure("What a match costs", plot,
                      "Squares and Huber's loss alike near zero, where the kernels are too.");
}

// What the tables say of the trials of one method. The pose errors are against the truth.
std::vector<Column<CaseOutcome>> paperColumns() {
  using Outcome = const CaseOutcome&;
  // A trial without an answer has no residual: a failure, whatever the field says.
  const auto answered = [](Outcome o) {
    return o.result.status != RegistrationStatus::kTooFewPoints && o.projection_residual_px;
  };
  const auto failed = [=](Outcome o) { return !answered(o) || !(*o.projection_residual_px <= kGrossFailure_px); };
  const auto pr_mm = [=](Outcome o) {
    return answered(o) ? Json(kPaperPixel_mm * *o.projection_residual_px) : Json(nullptr);
  };
  const auto rotation_deg = [](Outcome o) { return radToDeg(o.error->rotation_rad); };
  const auto centroid_mm = [](Outcome o) { return 1e3 * o.error->centroid_m; };
  const auto source_mm = [](Outcome o) { return 1e3 * o.error->source_m; };
  return {{"", "gfr_percent", "percent", failed},
          {"", "mean_pr_mm", "mean", pr_mm},
          {"", "p75_pr_mm", "p75", pr_mm},
          {"", "p95_pr_mm", "p95", pr_mm},
          {"", "mean_rotation_deg", "mean", rotation_deg},
          {"", "mean_centroid_mm", "mean", centroid_mm},
          {"", "mean_source_mm", "mean", source_mm},
          {"", "median_rotation_deg", "median", rotation_deg},
          {"", "median_centroid_mm", "median", centroid_mm},
          {"", "median_source_mm", "median", source_mm},
          {"", "pose_ok_percent", "percent", [=](Outcome o) { return rotation_deg(o) < 0.1 && centroid_mm(o) < 1; }},
          {"", "time_ms", "median", [](Outcome o) { return 1e3 * (o.image_s + o.result.times.total_s); }}};
}

Json figuresByName(const std::vector<EntrantRun>& runs) {
  Json json;
  for (const auto& run : runs) summarise(run.outcomes, paperColumns(), json[run.name]);
  return json;
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

std::optional<double> projectionResidual_px(const Eigen::Matrix3Xd& points_model, const Pose& T_camera_model,
                                            const XrayView& view) {
  const Eigen::MatrixX2d image = view.centerline.points_px.transpose();
  if (image.rows() == 0 || points_model.cols() == 0) return std::nullopt;
  const nanoflann::KDTreeEigenMatrixAdaptor<Eigen::MatrixX2d, 2> index(2, image, 10);
  double sum_px2 = 0;
  for (Eigen::Index i = 0; i < points_model.cols(); ++i) {
    const auto pixel = view.camera.project(view.T_view_first * (T_camera_model * points_model.col(i)));
    if (!pixel) return std::nullopt;
    Eigen::Index nearest = 0;
    double distance_px2 = 0;
    index.index->knnSearch(pixel->data(), 1, &nearest, &distance_px2);
    sum_px2 += distance_px2;
  }
  return std::sqrt(sum_px2 / static_cast<double>(points_model.cols()));
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

Json paperAsJson(const std::vector<EntrantRun>& table1, const std::vector<PaperLevel>& table3) {
  Json json = Json::object();
  if (!table1.empty()) {
    for (const auto& row : kPrintedTable1) {
      json["table1"]["paper"][row.name] = {{"gfr_percent", row.gfr_percent},
                                           {"mean_pr_mm", row.mean_pr_mm},
                                           {"p95_pr_mm", row.p95_pr_mm},
                                           {"p75_pr_mm", row.p75_pr_mm},
                                           {"time_ms", row.time_ms ? Json(*row.time_ms) : Json(nullptr)}};
    }
    json["table1"]["here"] = figuresByName(table1);
  }
  for (const auto& level : table3) {
    const PaperStart& p = level.start;
    json["table3"].push_back({{"rotation_std_deg", p.rotation_std_deg},
                              {"translation_std_mm", p.translation_std_mm},
                              {"paper",
                               {{"mean_pr_mm", p.mean_pr_mm},
                                {"gfr_percent", p.gfr_percent},
                                {"mean_rotation_deg", p.rotation_deg},
                                {"mean_centroid_mm", p.translation_mm}}},
                              {"here", figuresByName(level.runs)}});
  }
  return json;
}

std::string paperTable1(const Json& paper) {
  std::string table =
      "Table I: starts off by 2 deg and 5 mm (standard deviation per axis), noise-free\n\n"
      "| method | GFR, PR > 5 px | mean PR [mm] | 95 % | 75 % | ms | pose error, mean | median | pose ok |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
  for (const auto& [name, row] : paper["table1"]["paper"].items()) {
    table += "| paper: " + name +
             filled(
                 " | {gfr_percent:%.0f %%} | {mean_pr_mm:%.2f} | {p95_pr_mm:%.2f} | {p75_pr_mm:%.2f} | "
                 "{time_ms:%.1f} | - | - | - |\n",
                 row);
  }
  for (const auto& [name, f] : paper["table1"]["here"].items()) {
    table += "| " + name + filled(" | {gfr_percent:%.0f %%} | ", f) + small(f["mean_pr_mm"]) + " | " +
             small(f["p95_pr_mm"]) + " | " + small(f["p75_pr_mm"]) + filled(" | {time_ms:%.1f} | ", f) + poseCells(f);
  }
  return table +
         "PR: rms distance of all projected points from the nearest image point, 1 px = 0.30 mm as in the paper; it is "
         "small for a wrong pose, too. Pose error: rotation, and translation at the tree's centroid / at the source. "
         "Pose ok: within 0.1 deg and 1 mm at the centroid. The paper's times are those of its own machines.\n";
}

std::string paperTable3(const Json& paper) {
  std::string table =
      "Table III: what the spread of the starts leaves\n\n"
      "| start, std per axis | method | mean PR [mm] | GFR, PR > 5 px | pose error left, mean | median | pose ok |\n"
      "| --- | --- | --- | --- | --- | --- | --- |\n";
  for (const Json& level : paper["table3"]) {
    const std::string start = filled("| {rotation_std_deg:%g deg}, {translation_std_mm:%g mm}", level);
    table += start + filled(
                         " | paper: Iterative PnP | {mean_pr_mm:%.2f} | {gfr_percent:%.0f %%} | "
                         "{mean_rotation_deg:%.2f deg}, {mean_centroid_mm:%.2f mm} | - | - |\n",
                         level["paper"]);
    for (const auto& [name, f] : level["here"].items()) {
      table += start + " | " + name + " | " + small(f["mean_pr_mm"]) + filled(" | {gfr_percent:%.0f %%} | ", f) +
               poseCells(f);
    }
  }
  return table +
         "The paper does not say where it measures translation, nor whether the tree was rigid; ours are at the tree's "
         "centroid / at the source.\n";
}

std::string lossTable(const Json& levels) {
  std::string table =
      "Losses: the paper's method with its kernel, with Huber's loss and with squares\n\n"
      "| start, std per axis | method | mean PR [mm] | GFR, PR > 5 px | pose ok |\n| --- | --- | --- | --- | --- |\n";
  for (const Json& level : levels) {
    for (const auto& [name, f] : level["here"].items()) {
      table += filled("| {rotation_std_deg:%g deg}, {translation_std_mm:%g mm}", level) + " | " + name + " | " +
               small(f["mean_pr_mm"]) + filled(" | {gfr_percent:%.0f %%} | {pose_ok_percent:%.0f %%} |\n", f);
    }
  }
  return table;
}

std::string paperReportHtml(const PaperReport& report) {
  const Json& paper = report.paper;
  std::vector<EntrantRun> drawn;
  for (const EntrantRun& run : report.table1) {
    if (isDrawn(run.name)) drawn.push_back(run);
  }
  std::vector<std::string> sections;
  if (paper.contains("table1")) {
    std::vector<std::string> curves = {html::errorFigure(drawn), html::startAndEndFigure(drawn),
                                       html::captureFigure(drawn)};
    if (!report.machine.is_null()) curves.insert(curves.begin() + 1, html::timeFigure(drawn));
    sections.push_back(html::section("Table I", html::fromMarkdown(paperTable1(paper))));
    sections.push_back(html::section("The same, trial by trial, rigid", html::grid(curves)));
  }
  if (paper.contains("table2")) {
    sections.push_back(html::section("Table II", html::fromMarkdown(paperTable2(paper["table2"]))));
  }
  if (paper.contains("table3")) {  // Not there when the experiment was interrupted.
    const Json& levels = paper["table3"];
    const auto over_starts =
        html::grid({figureOver(levels, "Projection residual, rigid", "mean PR [mm]", "mean_pr_mm"),
                    figureOver(levels, "Gross failures, rigid", "GFR, PR > 5 px [%]", "gfr_percent"),
                    figureOver(levels, "Rotation left, rigid", "mean [deg]", "mean_rotation_deg"),
                    figureOver(levels, "Translation left at the centroid, rigid", "mean [mm]", "mean_centroid_mm")});
    sections.push_back(html::section("Table III", over_starts + html::fromMarkdown(paperTable3(paper))));
  }
  if (paper.contains("losses")) {
    const Json& levels = paper["losses"];
    sections.push_back(html::section(
        "Losses", html::grid({lossFigure(), figureOver(levels, "Gross failures", "GFR, PR > 5 px [%]", "gfr_percent"),
                              figureOver(levels, "Right poses", "pose ok [%]", "pose_ok_percent")}) +
                      html::fromMarkdown(lossTable(levels))));
  }
  if (paper.contains("visible_fraction")) {
    sections.push_back(html::section(
        "A part of the tree in view",
        html::sweepFigure(paper["visible_fraction"]) + html::fromMarkdown(sweepTable(paper["visible_fraction"]))));
  }
  if (paper.contains("point_sets")) {
    sections.push_back(
        html::section("The losses from 3D to 3D",
                      pointSetFigure(paper["point_sets"]) + html::fromMarkdown(pointSetTable(paper["point_sets"]))));
  }
  sections.push_back(html::settingsSection(report.settings_shown, report.machine));
  return html::page("Beside the paper",
                    "Its experiments on " + report.tree_name +
                        ": noise-free, one image point per point of the tree, another view in every trial. The paper's "
                        "tree, views and the unit of lengths in its prior are not known. " +
                        html::machineLine(report.machine),
                    sections);
}

}  // namespace angio::evaluation
