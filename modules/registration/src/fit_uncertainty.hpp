// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>

#include "angio/registration/result.hpp"
#include "local_misfit.hpp"
#include "tree_error.hpp"

namespace angio::registration {

/// What is claimed beyond an error's own word.
struct Claims {
  double factor = 1;                          ///< On its standard deviations.
  std::shared_ptr<const LocalMisfit> misfit;  ///< What single points are off by besides; null: nothing is known of that.
};

/// Returns the factor for a deformed tree in several views, by its alignment score. They leave little open, and less
/// than any process gets right where much is not explained: vessels were matched with their neighbours there.
double claimsOfViews(const AlignmentScore& alignment);

/// Sets what is uncertain of a result whose pose is set: covariances, deformation, spread, and single points as they
/// were when the fit came to rest.
///
/// @param points_centered  The tree's, 3 x N, about the centroid; the spread is that of a few of them.
void setUncertainty(const std::shared_ptr<const TreeError>& error, const Eigen::Matrix3Xd& points_centered,
                    const Pose& T_camera_centered, const Eigen::Vector3d& centroid, RegistrationResult& result,
                    const Claims& claims = {});

}  // namespace angio::registration
