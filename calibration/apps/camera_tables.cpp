// SPDX-License-Identifier: GPL-2.0-or-later
#include "camera_tables.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "angio/base/formatted.hpp"
#include "angio/base/joined.hpp"
#include "angio/calibration/camera_pictures.hpp"
#include "angio/evaluation/report_html.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/results/statistics.hpp"

namespace angio::apps {
namespace {

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

}  // namespace

std::string cameraViewsTable(const CameraCalibration& result) {
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

std::string cameraTable(const CameraCalibration& result) {
  const CalibrationRecord& record = result.record;
  std::string text = valuesTable(record);
  text += formatted("\nreprojection rms %.4g px, beads left out %.4g px, noise %.4g px per axis, %zu views",
                    record.residual_rms, result.left_out_rms_px, result.noise_px, result.views.size());
  text += record.held_out_rms ? formatted("; held out %.4g px\n", *record.held_out_rms) : "; no view held out\n";
  text += formatted("condition %.3g; ", record.condition) + focalAndDepth(record) + "\n";
  for (const WeakDirection& weak : record.weak_directions) {
    text += "weak direction: " + weak.name + formatted(", sigma %.3g ", weak.sigma) + weak.unit + "\n";
  }
  return text + outliers(result);
}

std::vector<ReportSection> cameraSections(const CameraCalibration& result, const std::vector<cv::Mat>& images,
                                          const std::string& prefix) {
  std::vector<ReportPicture> overlays;
  for (std::size_t v = 0; v < result.views.size(); ++v) {
    overlays.push_back({prefix + formatted("view-%03zu.png", v + 1),
                        result.views[v].name + formatted(": rms %.3f px", result.views[v].rms_px),
                        viewOverlay(result, v, images[v]), v == 0});
  }
  const ResidualField field = residualField(result);
  const std::string field_caption = formatted(
      "Residuals of all views, %.0f times as long: what points one way over a part of the detector is no noise",
      field.enlargement);
  return {{"Camera", html::fromMarkdown(cameraTable(result)), {}},
          {"Views", html::fromMarkdown(cameraViewsTable(result)), overlays},
          {"Detector",
           "",
           {{prefix + "residuals.png", field_caption, field.picture},
            {prefix + "coverage.png", "Beads seen in each part of the detector", coverageMap(result)}}}};
}

void writeCalibratedCamera(const std::string& path, const CameraCalibration& result, const std::string& machine,
                           const std::vector<CalibrationInput>& inputs) {
  CalibrationRecord record = result.record;
  record.machine = machine;
  record.date = dateNow();
  record.inputs = inputs;
  nlohmann::ordered_json json = cameraAsJson(result.camera);
  json["calibration"]["camera"] = recordAsJson(record);
  writeWholeFile(path, asYaml(json));
}

}  // namespace angio::apps
