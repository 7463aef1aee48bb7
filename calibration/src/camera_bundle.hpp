// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <ceres/cost_function.h>

#include <memory>
#include <vector>

#include "lens_model.hpp"

namespace angio::calibration {

/// A view in the bundle: its beads in phantom coordinates, where they were seen, and its pose.
struct BundleView {
  std::size_t index = 0;  ///< Among the views that were given.
  double distance_m = 1;
  Eigen::Matrix3Xd points_m;
  Eigen::Matrix2Xd seen_px;
  Eigen::VectorXd stds_px;  ///< Relative.
  std::vector<bool> use;    ///< Which beads count.
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

/// Throws InputError that names view, bead and rule for views that cannot be what they say: beads the phantom has not,
/// a bead twice, centres off the detector, too few beads, too few views, or one view over and over again.
void checkViews(const BeadPhantom& phantom, const DetectorOfViews& detector, const std::vector<BeadView>& views,
                const CameraCalibrationSettings& settings);

/// Solves the bundle: robustly first, then by least squares without the beads that are off and without the views that
/// another K would explain much better. Returns the given numbers of the views left out; the bundle has no longer got
/// them. Throws InputError that names the views when more of them disagree than may be left out, or beads of a view.
std::vector<std::size_t> solveRobustly(CameraBundle& bundle, const std::vector<BeadView>& views,
                                       const CameraCalibrationSettings& settings);

/// A closed-form start of the bundle, with all views in it (held-out ones too), each bead that fits no projection out
/// of use. Throws InputError by name for swapped beads, mirrored views, a plane seen at one tilt, and views that fit no
/// projection.
CameraBundle startOf(const BeadPhantom& phantom, const DetectorOfViews& detector, const std::vector<BeadView>& views,
                     const CameraCalibrationSettings& settings);

/// Throws InputError when the used views' geometry leaves focal length and depth nearly one direction, by the
/// information at the start: before anything is solved.
void requireObservable(const CameraBundle& start, const BeadPhantom& phantom, const std::vector<BeadView>& views,
                       const CameraCalibrationSettings& settings);

}  // namespace angio::calibration
