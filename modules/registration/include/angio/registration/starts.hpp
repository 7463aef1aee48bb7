// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/registration/registration.hpp"

namespace angio::registration {

/// A draw around `T_camera_model`: a turn and a shift about `centre_model`, normal with the given standard deviations
/// per axis. The same numbers on every machine for one `seed` and `index`.
Pose drawnPose(const Pose& T_camera_model, const Eigen::Vector3d& center_model, double rotation_std_rad,
               double translation_std_m, int seed, int index);

/// Six independent standard normal numbers, the same on every machine for one `seed` and `index`.
Vector6d unitDraw(int seed, int index);

/// One start of a search: drawn from the prior's covariance, or without one from the settings' spread, or anywhere in
/// the settings' box. The same for one seed and `index`.
Pose drawnStart(const PosePrior& prior, const Eigen::Vector3d& center_model, const StartSettings& starts, int index);

}  // namespace angio::registration
