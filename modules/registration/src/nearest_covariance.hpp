// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/registration/xray_view.hpp"
#include "pose_prior_term.hpp"

namespace angio::registration {

/// The covariance of a result's pose as iterative_pnp would give it there, for methods whose own cost is no sum of
/// squares: from matches of every projected point that a view sees with the nearest point of its centreline, weighed by
/// the kernel at 3 px. Nothing without a full-rank system.
///
/// @param points_centered  The tree's, about its centroid, 3 x N [m].
std::optional<Matrix6d> covarianceByNearest(const Eigen::Matrix3Xd& points_centered, const XrayViews& views,
                                            const Pose& T_camera_centered, const PosePriorTerm& prior,
                                            const Eigen::Vector3d& centroid_model);

}  // namespace angio::registration
