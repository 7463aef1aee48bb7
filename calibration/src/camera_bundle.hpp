// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <ceres/cost_function.h>

#include <memory>
#include <vector>

#include "lens_model.hpp"

namespace angio {

/// A view in the bundle: its beads in phantom coordinates, where they were seen, and its pose.
struct BundleView {
  std::size_t index = 0;  ///< Among the views that were given.
  double distance_m = 1;
  Eigen::Matrix3Xd points_m;
  Eigen::Matrix2Xd seen_px;
  Eigen::VectorXd sigmas_px;  ///< Relative.
  std::vector<bool> use;      ///< Which beads count.
  Pose T_camera_phantom = Pose::Identity();
};

/// K's parameters and all poses at once.
struct CameraBundle {
  LensModel model;
  LensParameters parameters;
  Eigen::VectorXd values;
  std::vector<BundleView> views;

  LensNumbers lens() const { return parameters.lens(values); }

  /// Projected less seen [px], one column a bead; of beads behind the camera nothing is known, and they are infinite.
  Eigen::Matrix2Xd residualsOf(const BundleView& view) const;

  /// Minimises the residuals over their sigmas, with Cauchy's loss of that scale, or squared when it is absent.
  /// Returns whether the solver's answer can be used.
  bool solve(std::optional<double> robust_scale, int max_iterations);
};

/// One bead's residual over its sigma by the lens parameters and the pose's change (v [m], w [rad]): p = exp(w) R x +
/// t + v. Analytic derivatives.
std::unique_ptr<ceres::CostFunction> beadCost(const CameraBundle& bundle, const BundleView& view, Eigen::Index bead);

/// The pose alone, by beads that count, with K as it is; squared residuals, Gauss-Newton with damping.
Pose fittedPose(const CameraBundle& bundle, const BundleView& view);

/// The normal equations of one view: poses have no part in each other's, so K's share is a Schur complement.
struct ViewInformation {
  Eigen::MatrixXd lens;  ///< n x n.
  Eigen::Matrix<double, 6, 6> pose;
  Eigen::MatrixXd cross;          ///< n x 6.
  Eigen::VectorXd lens_gradient;  ///< J^T r.
  Vector6d pose_gradient;
  double squared = 0;  ///< Sum of squares over sigmas.
  int residuals = 0;

  Eigen::MatrixXd reducedLens() const;  ///< lens - cross pose^-1 cross^T.
  Eigen::VectorXd reducedGradient() const;
};
ViewInformation informationOf(const CameraBundle& bundle, const BundleView& view);

}  // namespace angio
