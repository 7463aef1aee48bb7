// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "angio/calibration/bead_detection.hpp"
#include "angio/calibration/geometry_calibration.hpp"

namespace angio::calibration {

/// All that calibrateGeometry wants, from files: views of a phantom, or registered poses.
struct GeometryInput {
  std::string path;
  BeadPhantom phantom;
  std::vector<GeometryView> views;
  std::optional<PoseSet> poses;  ///< In place of phantom and views.
  GeometryCamera camera;
  std::string machine;
  std::vector<CalibrationRecord> records;  ///< The camera's own.
  std::vector<CalibrationInput> inputs;    ///< View set, phantom, camera, views; or pose set and camera.
};

/// Reads the camera's file and a view set (readViewSet), its phantom and images or tables, or, where the file has
/// `poses` and no `views`, a pose set (readPoseSet); beads lose the camera's distortion. Throws InputError that names
/// file, view, key, value and rule: what the readers refuse, a view without angles, a camera of another image size,
/// without pixel spacing or source-detector distance.
/// Shadows in images of an intensifier may be stretched. `tell` is called after each view with how many of how many
/// are done.
GeometryInput readGeometryInput(const std::string& views_path, const std::string& camera_path,
                                const BeadDetectionSettings& detection = {},
                                const std::function<void(int done, int total)>& tell = {});

/// The one of both calibrateGeometry that takes such an input.
GeometryCalibration calibrateGeometry(const GeometryInput& input, const GeometrySettings& settings = {});

}  // namespace angio::calibration
