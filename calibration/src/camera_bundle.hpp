// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "angio/calibration/bead_phantom.hpp"
#include "angio/calibration/camera_calibration.hpp"
#include "angio/calibration/direct_linear.hpp"
#include "angio/geometry/distortion.hpp"

namespace angio::calibration {

/// All a lens may have: fx, fy, cx, cy, skew [px], k1, k2, s1, s2 [rad], offset of the distance's encoder [m], motion
/// of the principal point with the distance (x, y) [px/m].
enum LensNumber { kFx, kFy, kCx, kCy, kSkew, kK1, kK2, kS1, kS2, kOffset, kSlopeX, kSlopeY, kLensNumbers };
using LensNumbers = Eigen::Matrix<double, kLensNumbers, 1>;

/// How those numbers make an image.
struct LensModel {
  LensKind kind = LensKind::kNone;
  Eigen::Vector2d middle_px{0, 0};  ///< Of the detector.
  double half_width_px = 1;
  double reference_distance_m = 1;               ///< Source-detector distance of fx to cy, by the encoder.
  std::optional<DetectorDistortion> known = {};  ///< Of the image that all of the above make.
  DisplacementPolynomial turn = {};  ///< Of the known map, by one radian of s1; no terms: it has not turned.

  /// Where a point in front of the camera is seen, at a source-detector distance; with derivatives by point and lens.
  Eigen::Vector2d seen(const LensNumbers& lens, double distance_m, const Eigen::Vector3d& p_camera,
                       Eigen::Matrix<double, 2, 3>* J_point = nullptr,
                       Eigen::Matrix<double, 2, kLensNumbers>* J_lens = nullptr) const;
};

/// The free ones among the numbers, in the units of their names: lens = fixed + map * parameters.
struct LensParameters {
  std::vector<std::string> names;  ///< "fx_px", "s1_deg", "source_detector_offset_mm".
  Eigen::MatrixXd map;             ///< kLensNumbers x names.
  LensNumbers fixed = LensNumbers::Zero();

  LensNumbers lens(const Eigen::VectorXd& parameters) const { return fixed + map * parameters; }
};
LensParameters freeParameters(const CameraCalibrationSettings& settings, bool several_distances,
                              bool turns_since_map = false);

/// A view in the bundle: its beads in phantom coordinates, where they were seen, and its pose.
struct BundleView {
  std::size_t index = 0;  ///< Among the views that were given.
  double distance_m = 1;
  Eigen::Matrix3Xd points_m;
  Eigen::Matrix2Xd seen_px;
  Eigen::VectorXd stds_px;  ///< Relative.
  std::vector<bool> use;    ///< Which beads count.
  std::vector<int> plate;   ///< Of each bead; empty when the phantom is of one piece.
  Pose T_camera_phantom = Pose::Identity();
};

/// K's parameters, the shifts of the phantom's plates and all poses at once.
struct CameraBundle {
  LensModel model;
  LensParameters parameters;  ///< Those of the plates' shifts move no lens number.
  Eigen::VectorXd values;     ///< Last, when there are plates, their shifts [mm].
  std::vector<BundleView> views;
  PhantomPlates plates;
  double plates_noise_px = 0;  ///< A bead's, against which what is known of the shifts is weighed.

  LensNumbers lens() const { return parameters.lens(values); }

  /// Where the shift of a bead's plate begins among the values; nothing for a phantom of one piece.
  std::optional<Eigen::Index> shiftOf(const BundleView& view, Eigen::Index bead) const;

  /// A bead with its plate's shift, in the phantom's frame.
  Eigen::Vector3d point_m(const BundleView& view, Eigen::Index bead) const;

  /// What is known of the shifts before, as normal equations of all values in units of a pixel's square.
  Eigen::MatrixXd priorInformation() const;

  /// Makes the shifts free, from what is known of them.
  void addPlates(const PhantomPlates& with, const std::vector<BeadView>& given);

  /// Projected less seen [px], one column a bead; of beads behind the camera nothing is known, and they are infinite.
  Eigen::Matrix2Xd residualsOf(const BundleView& view) const;

  /// Minimises the residuals over their sigmas, with Cauchy's loss of that scale, or squared when it is absent.
  /// Returns whether the solver's answer can be used.
  enum class Free { kAll, kPoses };
  bool solve(std::optional<double> robust_scale, int max_iterations, Free free = Free::kAll);
};

/// One bead's residual over its sigma by the lens parameters and the pose's change (v [m], w [rad]): p = exp(w) R x +
/// t + v. Analytic derivatives.
std::unique_ptr<ceres::CostFunction> beadCost(const CameraBundle& bundle, const BundleView& view, Eigen::Index bead);

/// The pose alone, by beads that count, with K as it is; squared residuals.
Pose fittedPose(const CameraBundle& bundle, const BundleView& view);

/// The normal equations of one view: poses have no part in each other's, so K's share is a Schur complement.
struct ViewInformation {
  Eigen::MatrixXd lens;  ///< n x n.
  Matrix6d pose = Matrix6d::Zero();
  Eigen::MatrixXd cross;          ///< n x 6.
  Eigen::VectorXd lens_gradient;  ///< J^T r.
  Vector6d pose_gradient = Vector6d::Zero();
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
