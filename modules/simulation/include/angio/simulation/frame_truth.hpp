// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/simulation/namespace.hpp"
#include "angio/simulation/patient_settings.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::simulation {

/// What a frame shows, in pixels of its image: an intensifier's distortion is in.
struct FrameTruth {
  /// Axes of the vessels that are seen and of the devices in the open field, with radius, contrast (of the vessel or
  /// device alone, without scatter: that of the beam through its axis) and kind. A piece that disappears ends its
  /// branch.
  Centerline2d centerline;
  std::vector<Eigen::Vector2d> collimator_opening_px;  ///< Corners of the collimator's opening.
};

}  // namespace angio::simulation
