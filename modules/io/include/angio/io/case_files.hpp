// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/io/namespace.hpp"

namespace angio::io {

/// One X-ray view of a case: its camera and what was seen, as a centreline or as an image (or both). Paths are as good
/// as the case file's own: its folder stands in front.
struct View {
  XrayCamera camera;
  std::optional<std::string> centerline_path;
  std::optional<std::string> image_path;
  Pose T_view_first = Pose::Identity();        ///< Camera frame of the first view in this one's [m].
  std::vector<Eigen::Vector2d> collimator_px;  ///< Corners of the open field, convex, in order; empty: all is open.
};

/// One registration to run.
struct Case {
  std::string name;
  std::string tree_path;
  std::vector<View> views;               ///< At least one; of one moment.
  Pose initial_pose = Pose::Identity();  ///< T_camera_model of the first view [m].
  std::optional<Pose> truth_pose;        ///< The same [m].
  std::optional<std::string> truth_displacements_path;
};

/// Cases to run in one go.
struct CaseSet {
  /// Consecutive frames: each case may start from what the ones before have shown. How their initial poses differ is
  /// then how the camera moved, as joints tell it.
  bool sequence = false;
  std::vector<Case> cases;
  std::optional<double> frame_period_s;  ///< Between the frames of a sequence [s], where it is known.
};

/// Reads a case set (YAML): `tree`, `camera`, `sequence`, `frame_period_s` and `cases`, each with `name`, `centerline`
/// or `image`, `initial_pose`, and optionally `truth_pose`, `truth_displacements` and its own `tree` and `camera`.
/// Relative paths start at the case file's folder. Cameras and poses are read at once; of the other files only their
/// existence is checked.
///
/// `frame`, LPS or RAS, in the set or in a case, names the patient axes of the tree that the poses are of. A tree
/// whose file says its axes (saysItsFrame(), which reads it where `frame` is RAS) is read as L, P, S, so that poses of
/// a RAS one are turned with it. Another tree is read as it stands, and nothing is turned.
///
/// Several views of one moment are lists: `camera`, and in each case `centerline` and `image` with as many entries in
/// the same order. Where the other cameras stand is said by `T_view_first`, beside `camera` in the set or in a case: a
/// list of pose files (readViewPose), one for each view; the first is the identity and may be left out. A camera may
/// also be a map of `camera`, its own `T_view_first`, which comes before the list's, and `collimator_px`: [[x, y],
/// ...].
///
/// Throws InputError that begins with the case file and line: missing files, repeated names, unknown keys, lists that
/// do not match, no case.
CaseSet readCaseSet(const std::string& path);

/// Writes what readCaseSet reads, with camera and pose files of its own beside it (`camera.yaml`, `view.yaml`,
/// `initial_0001.yaml`, `truth_0001.yaml`...); files of those names are replaced. The set's other paths are written
/// relative to the case file's folder where they lie in it. Throws InputError for a set that readCaseSet would refuse
/// for its cases (none, names given twice, no tree, view or image) and when a file cannot be written.
void writeCaseSet(const std::string& path, const CaseSet& set);

/// Reads where another view's camera stands: T_view_first [m], from a file as readPose takes it, whatever frames it
/// names. Throws InputError as readPose.
Pose readViewPose(const std::string& path);

}  // namespace angio::io
