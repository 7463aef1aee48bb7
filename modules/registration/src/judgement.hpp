// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/registration/result.hpp"
#include "rigid_step.hpp"

namespace angio {

/// Fewer points than this on either side cannot hold six unknowns against noise: sets the status and says so.
bool tooFewPoints(RegistrationResult& result);

/// Sets status and reason from the agreement of model and image.
void judge(RegistrationResult& result);

/// The same when it is known how well the best different pose does (score over this pose's, 0 to 1): one that fits nearly as well
/// makes a fit ambiguous; and a fit without a rival is believed when less of the image, or of the model, is explained, as when
/// contrast fills half of the tree.
void judgeAgainst(double rival_share, RegistrationResult& result);

/// Covariance as RegistrationResult defines it, from the system at the solution and the pulls of all views; nothing when it is
/// not of full rank.
std::optional<Matrix6d> covarianceOf(const NormalEquations& at_solution, const std::vector<Pull>& pulls,
                                     const Pose& T_camera_centred, const Eigen::Vector3d& centroid);

}  // namespace angio
