// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "deformation_process.hpp"
#include "residual_groups.hpp"
#include "tree_error.hpp"

namespace angio::registration {

/// The error of a rigid fit to a tree that may be deformed.
///
/// A tree that is deformed, or was traced a little wrong, leaves residuals that go together along vessels and over
/// centimetres, and the pose has followed them. How large both are is found from the residuals (errorSizes). The fit,
/// which did not know of the deformation, is a known linear function of it, and so is the error of every point.
class ModelError final : public TreeError {
 public:
  /// @param groups       Of the fit where it came to rest; some dozens. With fewer than kMinGroups no deformation is
  ///                     told.
  /// @param information  Of the fit (6 x 6, twist about the centroid, prior included).
  /// @param currency     What a squared residual counts in it [1/px^2].
  /// @param length_m     Over which a deformation goes together.
  ModelError(const std::vector<ResidualGroup>& groups, const Matrix6d& information, double currency, double length_m);

  Eigen::Matrix3d pointCovariance(const Eigen::Vector3d& at) const override;

 private:
  ResidualArrays groups_;
  DeformationProcess process_;
  Eigen::Matrix<double, 6, Eigen::Dynamic> gain_;  // How the twist follows a displacement of each group's vessel.
  double local_m_ = 0;
  Matrix6d by_deformation_ = Matrix6d::Zero();
};

}  // namespace angio::registration
