// SPDX-License-Identifier: GPL-2.0-or-later
// angio-calibrate geometry: how a C-arm's joints really move its camera.
#include <iostream>
#include <memory>
#include <optional>

#include "angio/apps/namespace.hpp"
#include "angio/base/formatted.hpp"
#include "angio/calibration/carm_files.hpp"
#include "angio/calibration/geometry_calibration.hpp"
#include "angio/calibration/geometry_pictures.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/io/settings_files.hpp"
#include "calibrate.hpp"
#include "outputs.hpp"

namespace angio::apps {
namespace {

struct GeometryOptions {
  std::string views, camera, out, settings, machine, report;
  std::optional<FlexModel> flex;
  double max_age_days = RecordGate().max_age_days;
};

std::string tableOf(const GeometryCalibration& found) {
  const CalibrationRecord& record = found.record;
  std::string table = formatted("%-36s %14s %12s\n", "", "value", "sigma");
  for (std::size_t i = 0; i < record.parameters.size(); ++i) {
    if (record.parameters[i].rfind("flex_", 0) == 0) continue;  // Many, and none means anything alone.
    const auto k = static_cast<Eigen::Index>(i);
    table += formatted("%-36s %14.5f %12.5f\n", record.parameters[i].c_str(), record.values[k],
                       std::sqrt(record.covariance(k, k)));
  }
  int used = 0;
  for (const auto& view : record.views) used += !view.outlier;
  table += formatted("\nviews %zu, used or held out %d", record.views.size(), used);
  if (found.bead_std_px) table += formatted("; beads +-%.3f px", *found.bead_std_px);
  const char* unit = record.residual_unit.c_str();
  table += formatted("\nresidual rms %.3f %s (rigid arm alone %.3f %s)", record.residual_rms, unit,
                     found.rms_without_flex, unit);
  if (record.held_out_rms) table += formatted(", held out %.3f %s", *record.held_out_rms, unit);
  table += formatted("\nnot explained by the joints: %.3f mm, %.4f deg a view, each axis\n", 1e3 * found.pose_scatter_m,
                     radToDeg(found.pose_scatter_rad));
  table += formatted("condition %.3g\n", record.condition);
  for (const auto& weak : record.weak_directions) {
    table += formatted("weak: %s (+-%.3g %s)\n", weak.name.c_str(), weak.sigma, weak.unit.c_str());
  }
  for (const auto& kept : found.kept) table += "kept: " + kept + "\n";
  for (const auto& doubt : found.doubts) table += doubt + "\n";
  return table;
}

void writeGeometryReport(const std::string& folder, const std::string& views, const GeometryCalibration& found) {
  std::vector<ReportPicture> pictures{
      {"residuals.png", "What joints do not explain of each view: the larger the ring, the larger the residual",
       residualsByAngle(found)},
      {"axes.png", "The axes near the isocentre, true to scale; an ideal arm's all go through its middle",
       axesSketch(found)}};
  if (found.carm.deviations.flex.count > 0) {
    pictures.push_back(
        {"flex.png", "How the arm bends, camera axes, over one angle while the other is zero", flexCurves(found)});
  }
  writeReport(folder, "Geometry of the C-arm", views,
              {{"Pictures", "", pictures}, {"Numbers", printed(tableOf(found)), {}}});
}

int runGeometry(const GeometryOptions& o) {
  const ClaimedOutputs claimed(o.out, o.report);
  GeometryFileSettings settings;
  if (!o.settings.empty()) settings = readSettings(o.settings, settings);
  settings.geometry.flex = o.flex.value_or(settings.geometry.flex);
  std::optional<ProgressBar> bar;
  const GeometryInput input = readGeometryInput(o.views, o.camera, settings.detection, [&](int done, int total) {
    if (!bar) bar.emplace("finding beads", total);
    bar->show(done);
  });
  bar.reset();
  const std::string machine = o.machine.empty() ? input.machine : o.machine;
  for (const auto& warning : checkRecords(o.camera, input.records, {machine, o.max_age_days})) {
    std::cerr << "angio-calibrate: " << warning << "\n";
  }
  const GeometryCalibration found = calibrateGeometry(input, settings.geometry);
  writeCArmFile(o.out, carmFileOf(input, found, machine));
  if (!o.report.empty()) writeGeometryReport(o.report, o.views, found);
  std::cout << tableOf(found);
  return 0;
}

}  // namespace

void addCalibrateGeometry(cli::Command& app, Work& work) {
  const auto o = std::make_shared<GeometryOptions>();
  auto* command = app.addSubcommand(
      "geometry", "How a C-arm's joints move its camera, from views of a bead phantom or registered poses");
  command->footer(
      "Example:\n  angio-calibrate geometry calibration/geometry/views.yaml --camera camera.yaml --out carm.yaml\n\n"
      "Views: over the range of both angles, some with the table moved along each axis, the phantom at rest on it; "
      "some with other source-detector distances; some held out. Or poses as hand-eye reads them, with their angles.");
  command->addOption("views", o->views, "Views of a phantom, or registered poses, with their angles (.yaml)")
      ->required();
  command->addOption("--camera", o->camera, "Camera, of angio-calibrate camera (.yaml)")->required();
  command->addOption("--out", o->out, "C-arm file (.yaml); T_dsa_cb is for hand-eye or registration to add")
      ->required();
  const std::map<std::string, FlexModel> flex{{"none", FlexModel::kNone}, {"low_order", FlexModel::kLowOrder}};
  command->addOption("--flex", o->flex, "Bending of the arm: none, low_order")
      ->check(choice(flex))
      ->defaultText("low_order");
  command->addOption("--machine", o->machine, "Whose C-arm it is; the view set's when not given");
  command->addOption("--max-calibration-age-days", o->max_age_days, "An older camera is warned of")
      ->check(between(0, 1e6));
  addSettingsOptions(*command, o->settings, "Settings (.yaml), sections detection and geometry",
                     settingsInForce<GeometryFileSettings>);
  command->addOption("--report", o->report, "Folder for pictures and a page (index.html)");
  command->onChosen([o, &work] { work = [o] { return runGeometry(*o); }; });
}

}  // namespace angio::apps
