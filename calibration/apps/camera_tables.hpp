// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/calibration/bead_detection.hpp"
#include "angio/calibration/camera_calibration.hpp"
#include "outputs.hpp"

namespace angio::apps {

/// The sections of a camera's settings file.
struct CameraSections {
  CameraCalibrationSettings camera;
  BeadDetectionSettings detection;

  void visit(SettingsVisitor& v) {
    v.section("camera", [this](SettingsVisitor& s) { camera.visit(s); });
    v.section("bead_detection", [this](SettingsVisitor& s) { detection.visit(s); });
  }
};

/// For a person: values and their standard deviations, residuals, condition, weak directions, what was left out.
std::string cameraTable(const CameraCalibration& result);

/// For a page: a row a view, in Markdown.
std::string cameraViewsTable(const CameraCalibration& result);

/// The sections of a camera's report; `images` are behind the views' overlays, or empty.
std::vector<ReportSection> cameraSections(const CameraCalibration& result, const std::vector<cv::Mat>& images,
                                          const std::string& prefix = "");

/// Writes the camera file with its record, which names machine and inputs.
void writeCalibratedCamera(const std::string& path, const CameraCalibration& result, const std::string& machine,
                           const std::vector<CalibrationInput>& inputs);

}  // namespace angio::apps
