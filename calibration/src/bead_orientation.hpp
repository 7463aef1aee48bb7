// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "angio/calibration/bead_detection.hpp"
#include "angio/calibration/bead_phantom.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::calibration {

/// How large the phantom is shown, and by that which size each bead and each detection has.
struct BeadScale {
  double px_per_m = 1;
  std::vector<int> bead_size, detection_size;  ///< Numbers of sizes from the smallest, one a bead or detection.
};

/// Scales at which most apparent radii are those of beads, best first, at least one.
std::vector<BeadScale> likelyScales(const BeadPhantom& phantom, const std::vector<double>& radii_px);

/// Rotations so that each is within about a step of one: directions on a Fibonacci sphere, each turned about itself.
std::vector<Eigen::Matrix3d> orientationGrid(double step_rad);

/// An orientation with the shift that puts most beads near a detection of their size.
struct OrientationVote {
  Eigen::Matrix3d R_camera_phantom = Eigen::Matrix3d::Identity();
  Eigen::Vector2d center_px{0, 0};  ///< Where the phantom's centre is seen.
  int votes = 0;
};

/// Lets pairs of beads and detections vote for shifts of the phantom, seen without perspective.
class OrientationVotes {
 public:
  OrientationVotes(const BeadPhantom& phantom, const std::vector<BeadDetection>& detections, const BeadScale& scale,
                   double step_rad);

  /// Width of what counts as one shift: about how far a step of rotation moves beads.
  double bin_px() const { return bin_px_; }

  /// The `count` best of these orientations, best first.
  std::vector<OrientationVote> best(const std::vector<Eigen::Matrix3d>& orientations, std::size_t count) const;

 private:
  using Votes = std::vector<short>;  // By bin, row after row.
  // Detections of one size [bins], and which beads have that size.
  struct Size {
    std::vector<float> x, y;
    std::vector<Eigen::Index> beads;
  };

  OrientationVote vote(const Eigen::Matrix3d& R, Votes& bins) const;
  OrientationVote mostIn(const Votes& bins) const;

  Eigen::Matrix3Xd points_px_;  // About the centre, times the scale.
  std::vector<Size> sizes_;
  double bin_px_;
  Eigen::Vector2d low_px_;
  int columns_, rows_;
};

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

}  // namespace angio::calibration
