// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/calibration/bead_detection.hpp"

namespace angio::calibration {

/// How large the phantom is shown, and by that which size each bead and each detection has.
struct BeadScale {
  double px_per_m = 1;
  std::vector<int> bead_size, detection_size;  ///< Numbers of sizes from the smallest, one a bead or detection.
};

/// An orientation with the shift that puts most beads near a detection of their size.
struct OrientationVote {
  Eigen::Matrix3d R_camera_phantom = Eigen::Matrix3d::Identity();
  Eigen::Vector2d center_px{0, 0};  ///< Where the phantom's centre is seen.
  int votes = 0;
};

/// An orientation refined to a projection, and what it explains.
struct Refinement : BeadMatch {
  double share = 0;  ///< The lesser of: matched of all seen, matched of those that should be seen where others are.
};

/// Returns where the detections are, one column each [px].
Eigen::Matrix2Xd placesOf(const std::vector<BeadDetection>& detections);

/// Assigns detections to the beads nearest to where they are thought to be, fits an affine projection, then one with
/// perspective, then one with a smooth bend of the image over it (a cubic polynomial, as detectors have distortion),
/// with ever less tolerance.
Refinement refinedMatch(const BeadPhantom& phantom, const std::vector<BeadDetection>& detections,
                        const BeadScale& scale, const OrientationVote& start, double bin_px, double tolerance_px);

}  // namespace angio::calibration
