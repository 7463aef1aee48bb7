// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "bead_orientation.hpp"

namespace angio {

/// An orientation refined to a projection, and what it explains.
struct Refinement {
  std::vector<std::optional<int>> bead;  ///< One a detection.
  int matched = 0;
  double share = 0;  ///< The lesser of: matched of all seen, matched of those that should be seen where others are.
  Eigen::Matrix3d R_camera_phantom = Eigen::Matrix3d::Identity();
};

/// Assigns detections to the beads nearest to where they are thought to be, fits an affine projection, then one with
/// perspective, then one with a smooth bend of the image over it (a cubic polynomial, as detectors have distortion),
/// with ever less tolerance.
Refinement refinedMatch(const BeadPhantom& phantom, const std::vector<BeadDetection>& detections,
                        const BeadScale& scale, const OrientationVote& start, double bin_px, double tolerance_px);

}  // namespace angio
