// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/conventions/namespace.hpp"
#include "angio/geometry/carm.hpp"

namespace angio::conventions {

/// A C-arm as a robot description (URDF), for ROS and the programs that read it. Metres and radians.
///
/// Links: `isocentre` (axes L, P, S of a patient who lies straight, table at zero) is the root, `gantry`, `arm`,
/// `camera` (origin at the source, z to the detector, x right and y down in the image) and `detector` hang on it by the
/// joints `primary` and `secondary`; `patient`, the frame that T_dsa_cb maps into, by `table_x`, `table_y`, `table_z`.
/// Positions are the encoders', but for a table axis whose column of `deviations.table` is not one long: an axis of a
/// URDF is, so that its joint moves by what a transmission says.
struct CArmUrdf {
  std::string text;
  /// How far, at most within the limits, the arm's bending moves the camera, which a URDF has no word for and so lacks.
  double left_out_mm = 0;
  double left_out_deg = 0;
};

/// @param name  Of the robot; empty: carm.
CArmUrdf carmAsUrdf(const CArmGeometry& carm, const CArmLimits& limits, const std::string& name = "");

}  // namespace angio::conventions
