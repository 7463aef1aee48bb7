// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/registration/result.hpp"
#include "rigid_step.hpp"

namespace angio {

/// Fewer points than this on either side cannot hold six unknowns against noise: sets the status and says so.
bool tooFewPoints(RegistrationResult& result);

/// Sets status and reason from the agreement of model and image.
void judge(RegistrationResult& result);

/// Covariance as RegistrationResult defines it, from the system at the solution; nothing when it is not of full rank.
std::optional<Matrix6d> covarianceOf(const NormalEquations& at_solution, const Pull& pull, const Pose& T_camera_centred,
                                     const Eigen::Vector3d& centroid);

}  // namespace angio
