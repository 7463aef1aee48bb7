// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"

namespace angio {

/// One X-ray view of a case: its camera and what was seen, as a centreline or as an image (or both). Paths are as good
/// as the case file's own: its folder stands in front.
struct View {
  XrayCamera camera;
  std::optional<std::string> centerline_path;
  std::optional<std::string> image_path;
};

/// One registration to run.
struct Case {
  std::string name;
  std::string tree_path;
  std::vector<View> views;               ///< Exactly one.
  Pose initial_pose = Pose::Identity();  ///< T_camera_model [m].
  std::optional<Pose> truth_pose;        ///< T_camera_model [m].
  std::optional<std::string> truth_displacements_path;
};

/// Cases to run in one go.
struct CaseSet {
  bool sequence = false;  ///< Consecutive frames: each case may start from the last one's result.
  std::vector<Case> cases;
};

/// Reads a case set (YAML): `tree`, `camera`, `sequence` and `cases`, each with `name`, `centerline` or `image`,
/// `initial_pose`, and optionally `truth_pose`, `truth_displacements` and its own `tree` and `camera`. Relative paths
/// start at the case file's folder. Cameras and poses are read at once; of the other files only their existence is
/// checked.
///
/// Throws InputError that begins with the case file and line: missing files, repeated names, unknown keys, more than
/// one view, no case.
CaseSet readCaseSet(const std::string& path);

}  // namespace angio
