// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "angio/calibration/bead_detection.hpp"
#include "angio/calibration/geometry_calibration.hpp"

namespace angio {

/// All that calibrateGeometry wants, from files.
struct GeometryInput {
  BeadPhantom phantom;
  GeometryCamera camera;
  std::vector<GeometryView> views;
  std::string machine;
  std::vector<CalibrationRecord> records;  ///< The camera's own.
  std::vector<CalibrationInput> inputs;    ///< View set, phantom, camera, views.
};

/// Reads a view set (readViewSet), its phantom and images or tables, and the camera's file; beads lose the camera's
/// distortion. Throws InputError that names file, view, key, value and rule: what the readers refuse, a view without
/// angles, a camera of another image size, without pixel spacing or source-detector distance.
/// Shadows in images of an intensifier may be stretched. `tell` is called after each view with how many of how many
/// are done.
GeometryInput readGeometryInput(const std::string& views_path, const std::string& camera_path,
                                const BeadDetectionSettings& detection = {},
                                const std::function<void(int done, int total)>& tell = {});

}  // namespace angio
