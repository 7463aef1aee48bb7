// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

#include "deformation_nodes.hpp"
#include "line_gate.hpp"
#include "oriented_frame.hpp"
#include "oriented_model.hpp"

namespace angio::registration {

/// From which amplitude of a deformation on, tails included, a tree is worth finding again across the beam of one view
/// [m]. Trees deformed by 1 mm gain little (0.21 mm off in place of 0.22 mm).
inline constexpr double kWorthRefining_m = 2.5e-3;

/// An image that shows less than this of the length of model in view is of a few lines alone, as a catheter's: most
/// vessels have no image and must not be pulled to one.
inline constexpr double kFewLines = 0.25;

/// Finds a deformed tree again across the beam of one view: each place moves to where the process and the finer groups
/// of several views have it, the pose being known, and keeps its depth, of which they would claim too much. Twice,
/// unless the first time moves it by less than 0.3 mm (rms).
///
/// @param nodes      Of the model.
/// @param length_m   Over which the deformation goes together: see DeformationProcess.
/// @param frame      Of one view.
/// @param T_camera_centered  Pose of the centred model.
/// @param displaced  The model's points as they have been found, about the centroid, 3 x N [m].
/// Returns the points, 3 x N [m]; as they were where the image is of a few lines alone, or too little of it is
/// matched: of vessels that have no image the smooth process says more.
Eigen::Matrix3Xd refinedAcrossBeam(const OrientedModel& model, const DeformationNodes& nodes, double length_m,
                                   const OrientedFrame& frame, const Pose& T_camera_centered,
                                   Eigen::Matrix3Xd displaced, LineGate gate);

}  // namespace angio::registration
