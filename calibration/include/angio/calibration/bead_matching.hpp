// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/calibration/bead_detection.hpp"
#include "angio/calibration/bead_phantom.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::calibration {

/// How beads are told apart.
struct BeadMatchingSettings {
  static constexpr double rotation_step_deg = 8;  ///< Between the orientations that are tried.
  static constexpr double min_share =
      0.6;                    ///< Of the beads that should be in the image, and of those seen, that must agree.
  double tolerance_px = 2.5;  ///< Between a bead and its projection when all is done.

  void visit(SettingsVisitor& v) { v.number("tolerance_px", tolerance_px, 0.1, 50); }
};

/// Which detection is which bead.
struct BeadMatch {
  std::vector<std::optional<int>> bead;  ///< One a detection; nothing for what is no bead.
  int matched = 0;
  Eigen::Matrix3d R_camera_phantom = Eigen::Matrix3d::Identity();  ///< About; a start for the next view.
};

/// Tells beads apart in one view without any start: apparent sizes say the scale and which beads are large; each
/// orientation of a grid over all rotations, those near `likely` first, puts the beads' places over those seen, and the
/// best of them are refined to a projection. A mirrored image matches as well: a projection without perspective cannot
/// tell it, the projection matrix afterwards does.
///
/// Throws InputError that begins with `place` when a detection has no radius, when too few beads are seen, and when no
/// orientation explains them.
BeadMatch matchBeads(const std::string& place, const BeadPhantom& phantom, const std::vector<BeadDetection>& detections,
                     const std::vector<Eigen::Matrix3d>& likely = {}, const BeadMatchingSettings& settings = {});

}  // namespace angio::calibration
