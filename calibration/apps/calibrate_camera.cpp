// SPDX-License-Identifier: GPL-2.0-or-later
// angio-calibrate camera: K, and distortion, from views of a phantom or a grid.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/joined.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/calibration/camera_calibration.hpp"
#include "angio/calibration/camera_pictures.hpp"
#include "angio/calibration/view_set.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/evaluation/report_html.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/results/statistics.hpp"
#include "calibrate.hpp"
#include "outputs.hpp"

namespace angio::apps {
namespace {

struct CameraOptions {
  std::string views, settings, out, report, distortion;
  bool square_pixels = false, skew = false;
  double noise_px = 0;
};

struct CameraSections {
  CameraCalibrationSettings camera;
  BeadDetectionSettings detection;

  void visit(SettingsVisitor& v) {
    v.section("camera", [this](SettingsVisitor& s) { camera.visit(s); });
    v.section("bead_detection", [this](SettingsVisitor& s) { detection.visit(s); });
  }
};

CameraSections settingsOf(const CameraOptions& o) {
  CameraSections sections;
  if (!o.settings.empty()) sections = readSettings(o.settings, sections);
  CameraCalibrationSettings& camera = sections.camera;
  if (o.distortion == "none") camera.distortion = LensKind::kNone;
  if (o.distortion == "radial") camera.distortion = LensKind::kRadial;
  if (o.distortion == "intensifier") camera.distortion = LensKind::kIntensifier;
  if (camera.distortion == LensKind::kIntensifier) sections.detection = sections.detection.throughIntensifier();
  camera.square_pixels |= o.square_pixels;
  camera.skew |= o.skew;
  if (o.noise_px > 0) camera.noise_px = o.noise_px;
  return sections;
}

std::string valuesTable(const CalibrationRecord& record) {
  std::vector<std::vector<std::string>> rows{{"", "value", "sigma"}};
  for (std::size_t k = 0; k < record.parameters.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    rows.push_back({record.parameters[k], formatted("%.6g", record.values[i]),
                    formatted("%.2g", std::sqrt(record.covariance(i, i)))});
  }
  return markdownTable(rows);
}

// How much of the focal length's uncertainty is shared with depth, whether or not it is called weak.
std::string focalAndDepth(const CalibrationRecord& record) {
  const Eigen::Index depth = record.values.size() - 1;
  const Eigen::MatrixXd& C = record.covariance;
  return formatted("correlation of %s with mean_depth_mm: %.4f", record.parameters[0].c_str(),
                   C(0, depth) / std::sqrt(C(0, 0) * C(depth, depth)));
}

std::string outliers(const CameraCalibration& result) {
  std::vector<std::string> left_out, beads;
  for (const CalibratedView& view : result.views) {
    if (view.left_out) left_out.push_back(view.name);
    std::vector<std::string> numbers;
    for (std::size_t i = 0; i < view.beads.size(); ++i) {
      if (view.is_outlier[i]) numbers.push_back(std::to_string(view.beads[i].bead));
    }
    if (!numbers.empty()) beads.push_back(view.name + ": " + joined(numbers));
  }
  std::string of_beads;
  for (const std::string& of_view : beads) of_beads += (of_beads.empty() ? "" : "; ") + of_view;
  return "views left out: " + (left_out.empty() ? "none" : joined(left_out)) +
         "\nbeads left out: " + (beads.empty() ? "none" : of_beads) + "\n";
}

std::string viewsTable(const CameraCalibration& result) {
  std::vector<std::vector<std::string>> rows{{"view", "beads", "left out", "rms px", ""}};
  for (const CalibratedView& view : result.views) {
    rows.push_back({view.name, std::to_string(view.beads.size()),
                    std::to_string(std::count(view.is_outlier.begin(), view.is_outlier.end(), true)),
                    formatted("%.3f", view.rms_px),
                    view.left_out   ? "left out"
                    : view.held_out ? "held out"
                                    : ""});
  }
  return markdownTable(rows);
}

// The image behind a view's overlay; nothing for a table.
cv::Mat imageBehind(const PhantomView& view) { return view.is_table ? cv::Mat() : readXrayImage(view.path); }

// For a person: values and their standard deviations, residuals, condition, weak directions, what was left out.
std::string cameraTable(const CameraCalibration& result) {
  const CalibrationRecord& record = result.record;
  std::string text = valuesTable(record);
  text += formatted("\nreprojection rms %.4g px, noise %.4g px per axis, %zu views", record.residual_rms,
                    result.noise_px, result.views.size());
  text += record.held_out_rms ? formatted("; held out %.4g px\n", *record.held_out_rms) : "; no view held out\n";
  text += formatted("condition %.3g; ", record.condition) + focalAndDepth(record) + "\n";
  for (const WeakDirection& weak : record.weak_directions) {
    text += "weak direction: " + weak.name + formatted(", sigma %.3g ", weak.sigma) + weak.unit + "\n";
  }
  return text + outliers(result);
}

// The camera file with its record, which names `views`, the hashes of the views' files.
void writeCalibratedCamera(const std::string& path, const CameraCalibration& result, const ViewSet& set,
                           const std::vector<CalibrationInput>& views) {
  CalibrationRecord record = result.record;
  record.machine = set.machine;
  record.date = dateNow();
  record.inputs = {hashedInput(set.path)};
  if (!set.phantom_path.empty()) record.inputs.push_back(hashedInput(set.phantom_path));
  record.inputs.insert(record.inputs.end(), views.begin(), views.end());
  nlohmann::ordered_json json = cameraAsJson(result.camera);
  json["calibration"]["camera"] = recordAsJson(record);
  writeWholeFile(path, asYaml(json));
}

// Each view's beads as seen and as projected, the residuals over the detector, enlarged, and where beads were seen.
void writeCameraReport(const std::string& folder, const CameraCalibration& result, const ViewSet& set) {
  std::vector<ReportPicture> overlays;
  for (std::size_t v = 0; v < result.views.size(); ++v) {
    overlays.push_back({formatted("view-%03zu.png", v + 1),
                        result.views[v].name + formatted(": rms %.3f px", result.views[v].rms_px),
                        viewOverlay(result, v, imageBehind(set.views[v])), v == 0});
  }
  const ResidualField field = residualField(result);
  const std::string field_caption = formatted(
      "Residuals of all views, %.0f times as long: what points one way over a part of the detector is no noise",
      field.enlargement);
  writeReport(folder, "Camera calibration", set.path,
              {{"Camera", html::fromMarkdown(cameraTable(result)), {}},
               {"Views", html::fromMarkdown(viewsTable(result)), overlays},
               {"Detector",
                "",
                {{"residuals.png", field_caption, field.picture},
                 {"coverage.png", "Beads seen in each part of the detector", coverageMap(result)}}}});
}

int runCamera(const CameraOptions& o) {
  const ClaimedOutputs claimed(o.out, o.report);
  const CameraSections settings = settingsOf(o);
  const ViewSet set = readViewSet(o.views);
  const BeadPhantom phantom = phantomOf(set);
  Stopwatch watch;
  SeenViewSet seen;
  {
    ProgressBar bar("finding beads", static_cast<int>(set.views.size()));
    seen = seenViews(set, phantom, settings.detection, [&](int done) { bar.show(done); });
  }
  const double seen_s = watch.seconds();
  watch = {};
  const CameraCalibration result = [&] {
    try {
      return calibrateCamera(phantom, seen.detector, seen.views, settings.camera);
    } catch (const InputError& error) {
      throw error.within(o.views);
    }
  }();
  const double solved_s = watch.seconds();
  if (!o.out.empty()) writeCalibratedCamera(o.out, result, set, seen.inputs);
  if (!o.report.empty()) writeCameraReport(o.report, result, set);
  std::cout << cameraTable(result)
            << formatted("time: beads %.2f s, calibration of %zu views %.3f s\n", seen_s, result.views.size(),
                         solved_s);
  return 0;
}

}  // namespace

void addCalibrateCamera(cli::Command& app, Work& work) {
  const auto o = std::make_shared<CameraOptions>();
  auto* command = app.addSubcommand("camera", "K, distortion and their uncertainty, from views of beads or of a grid");
  command->footer(
      "Example:\n  angio-calibrate camera views.yaml --distortion intensifier --out camera.yaml --report report");
  command
      ->addOption("views", o->views,
                  "View set (.yaml): images of beads, of a chessboard or of a circle grid, or tables")
      ->required();
  command->addOption("--distortion", o->distortion, "Of the detector; the settings' choice (none) when not given")
      ->check(cli::oneOf({"none", "radial", "intensifier"}));
  command->addFlag("--square-pixels", o->square_pixels, "One focal length for both axes");
  command->addFlag("--skew", o->skew, "Let the detector's columns lean");
  command->addOption("--noise-px", o->noise_px, "Known error of a bead's centre per axis; 0: by the residuals")
      ->check(between(0, 100));
  addSettingsOptions(*command, o->settings, "Settings (.yaml), sections camera and bead_detection",
                     settingsInForce<CameraSections>);
  command->addOption("--out", o->out, "The camera with its record (.yaml)");
  command->addOption("--report", o->report, "Folder for pictures and a page (index.html)");
  command->onChosen([o, &work] { work = [o] { return runCamera(*o); }; });
}

}  // namespace angio::apps
