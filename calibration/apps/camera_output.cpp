// SPDX-License-Identifier: GPL-2.0-or-later
#include "camera_output.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/formatted.hpp"
#include "angio/calibration/camera_pictures.hpp"
#include "angio/evaluation/report_html.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/whole_file.hpp"
#include "report_folder.hpp"

namespace angio {
namespace {

std::string valuesTable(const CalibrationRecord& record) {
  std::string text = "| | value | sigma |\n| --- | --- | --- |\n";
  for (std::size_t k = 0; k < record.parameters.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    text += formatted("| %s | %.6g | %.2g |\n", record.parameters[k].c_str(), record.values[i],
                      std::sqrt(record.covariance(i, i)));
  }
  return text;
}

// How much of the focal length's uncertainty is shared with depth, whether or not it is called weak.
std::string focalAndDepth(const CalibrationRecord& record) {
  const Eigen::Index depth = record.values.size() - 1;
  const Eigen::MatrixXd& C = record.covariance;
  return formatted("correlation of %s with mean_depth_mm: %.4f", record.parameters[0].c_str(),
                   C(0, depth) / std::sqrt(C(0, 0) * C(depth, depth)));
}

std::string viewNames(const std::vector<const CalibratedView*>& views) {
  std::string names;
  for (const auto* view : views) names += (names.empty() ? "" : ", ") + view->name;
  return names.empty() ? "none" : names;
}

std::string outliers(const CameraCalibration& result) {
  std::vector<const CalibratedView*> left_out;
  std::string beads;
  for (const CalibratedView& view : result.views) {
    if (view.left_out) left_out.push_back(&view);
    std::string numbers;
    for (std::size_t i = 0; i < view.beads.size(); ++i) {
      if (view.is_outlier[i]) numbers += (numbers.empty() ? "" : ", ") + std::to_string(view.beads[i].bead);
    }
    if (!numbers.empty()) beads += (beads.empty() ? "" : "; ") + view.name + ": " + numbers;
  }
  return "views left out: " + viewNames(left_out) + "\nbeads left out: " + (beads.empty() ? "none" : beads) + "\n";
}

std::string viewsTable(const CameraCalibration& result) {
  std::string text = "| view | beads | left out | rms px | |\n| --- | --- | --- | --- | --- |\n";
  for (const CalibratedView& view : result.views) {
    const auto left_out = std::count(view.is_outlier.begin(), view.is_outlier.end(), true);
    text +=
        formatted("| %s | %zu | %d | %.3f | %s |\n", view.name.c_str(), view.beads.size(), static_cast<int>(left_out),
                  view.rms_px, view.left_out ? "left out" : (view.held_out ? "held out" : ""));
  }
  return text;
}

// The image behind a view's overlay; nothing for a table.
cv::Mat imageBehind(const PhantomView& view) { return view.is_table ? cv::Mat() : readXrayImage(view.path); }

}  // namespace

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

void writeCalibratedCamera(const std::string& path, const CameraCalibration& result, const ViewSet& set,
                           const std::vector<CalibrationInput>& views) {
  CalibrationRecord record = result.record;
  record.machine = set.machine;
  record.date = dateNow();
  record.inputs = {hashedInput(set.path), hashedInput(set.phantom_path)};
  record.inputs.insert(record.inputs.end(), views.begin(), views.end());
  nlohmann::ordered_json json = cameraAsJson(result.camera);
  json["calibration"]["camera"] = recordAsJson(record);
  writeWholeFile(path, asYaml(json));
}

void writeCameraReport(const std::string& folder, const CameraCalibration& result, const ViewSet& set) {
  const ReportFolder report(folder);
  std::vector<std::string> overlays;
  for (std::size_t v = 0; v < result.views.size(); ++v) {
    const cv::Mat picture = viewOverlay(result, v, imageBehind(set.views[v]));
    report.picture(formatted("view-%03zu.png", v + 1), picture);
    overlays.push_back(
        html::picture(picture, result.views[v].name + formatted(": rms %.3f px", result.views[v].rms_px)));
  }
  const ResidualField field = residualField(result);
  const cv::Mat coverage = coverageMap(result);
  report.picture("residuals.png", field.picture);
  report.picture("coverage.png", coverage);
  report.overview({viewOverlay(result, 0, imageBehind(set.views[0])), field.picture, coverage});
  const std::string maps =
      html::grid({html::picture(field.picture, formatted("Residuals of all views, %.0f times as long: what points one "
                                                         "way over a part of the detector is no noise",
                                                         field.enlargement)),
                  html::picture(coverage, "Beads seen in each part of the detector")});
  report.page("Camera calibration", set.path,
              {html::section("Camera", html::fromMarkdown(cameraTable(result))), html::section("Detector", maps),
               html::section("Views", html::fromMarkdown(viewsTable(result)) + html::grid(overlays))});
}

}  // namespace angio
