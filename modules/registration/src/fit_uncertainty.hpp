// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>

#include "angio/registration/result.hpp"
#include "local_misfit.hpp"
#include "tree_error.hpp"

namespace angio::registration {

/// What is claimed beyond an error's own word.
struct Claims {
  /// Of intervals that hold 90 % and not more, the deformation without its tails.
  struct Central {
    double factor;        ///< On the standard deviations, besides the factor for all.
    double misfit_share;  ///< Of the misfits' variance, that counts.
  };

  double factor = 1;                          ///< On its standard deviations.
  std::shared_ptr<const LocalMisfit> misfit;  ///< What single points are off by besides; null: nothing is known.
  double misfit_share = 1;                    ///< Of its variance, that counts.
  std::optional<Central> central = {};        ///< Null: errors are normal.
};

/// Returns the claims of a deformed tree by its alignment score. A process gets less right where much is not explained:
/// vessels were matched with their neighbours there.
Claims claimsOfDeformed(const AlignmentScore& alignment, std::size_t views, std::shared_ptr<const LocalMisfit> misfit);

/// Sets what is uncertain of a result whose pose is set: covariances, deformation, spread, and single points as they
/// were when the fit came to rest.
///
/// @param points_centered  The tree's, 3 x N, about the centroid; the spread is that of a few of them.
void setUncertainty(const std::shared_ptr<const TreeError>& error, const Eigen::Matrix3Xd& points_centered,
                    const Pose& T_camera_centered, const Eigen::Vector3d& centroid, RegistrationResult& result,
                    const Claims& claims = {});

}  // namespace angio::registration
