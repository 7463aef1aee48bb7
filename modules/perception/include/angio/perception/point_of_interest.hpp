// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/geometry/se3.hpp"
#include "angio/perception/namespace.hpp"

namespace angio::perception {

/// A place of the model that a task wants to have seen for itself, besides the tree as a whole.
struct PointOfInterest {
  Eigen::Vector3d model = Eigen::Vector3d::Zero();  ///< [m].
  double near_m = 0;  ///< How far around it the image is looked at for how it lies; 0: not at all.
  double std_m = 0;   ///< How far it may lie from where the registration puts it, per axis.
};

/// How far the image shows a place from where it has been put.
struct ImageShift {
  Eigen::Vector2d shift_px;       ///< From the projected to the seen place: the mean over both cases of `probability`.
  Eigen::Matrix2d covariance_px;  ///< Along a single straight vessel nothing is seen: the prior's, there.
  double probability = 1;         ///< That the place lies off where the registration has it.

  /// What the image shows if it does: `shift_px` is `probability` times that.
  Eigen::Vector2d seen_px = shift_px;
  Eigen::Matrix2d seen_covariance_px = covariance_px;
};

/// What a frame shows of a watched place.
struct PointObservation {
  /// The registration as it is around the place: the tree's, carried across the beam to where a deformed one has the
  /// place. How far along the beam, one view does not tell.
  Pose T_camera_model = Pose::Identity();
  std::optional<ImageShift> image_shift;  ///< From there; nothing when no vessel near the place is in the image.
};

}  // namespace angio::perception
