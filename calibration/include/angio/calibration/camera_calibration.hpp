// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/calibration/bead_phantom.hpp"
#include "angio/calibration/phantom_plates.hpp"
#include "angio/calibration_records/record.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/io/camera_files.hpp"

namespace angio::calibration {

/// A bead in a view, and which one it is.
struct SeenBead {
  int bead = 0;                     ///< Its number in the phantom.
  Eigen::Vector2d center_px{0, 0};  ///< Of the image, distortion and all.
  double std_px = 1;                ///< Per axis, against the others'.
};

/// One view of the phantom.
struct BeadView {
  std::string name;
  std::vector<SeenBead> beads;
  std::optional<double> source_detector_distance_m;  ///< By the encoder.
  bool held_out = false;                             ///< Takes no part; its error is reported.
  CArmJoints joints = CArmJoints::Zero();            ///< By the encoders [rad, m]; of no account for the camera.
};

enum class LensKind { kNone, kRadial, kIntensifier };

/// How a camera is calibrated.
struct CameraCalibrationSettings {
  LensKind distortion = LensKind::kNone;
  bool square_pixels = false;
  bool skew = false;
  double noise_px = 0;
  static constexpr double outlier_stds =
      6;  ///< A bead farther off, in robust standard deviations, is left out and named.
  static constexpr double max_outlier_share =
      0.25;  ///< Of views, and of a view's beads; beyond it the data are refused.
  static constexpr double max_focal_std =
      0.02;  ///< Relative; predicted for the worst noise to be expected, before solving.
  static constexpr int max_iterations = 100;

  void visit(SettingsVisitor& v) {
    v.choice("distortion", distortion, {"none", "radial", "intensifier"},
             "Distortion of the detector that is estimated");
    v.flag("square_pixels", square_pixels, "One focal length for both axes");
    v.flag("skew", skew, "Columns may lean (not with an intensifier)");
    v.number("noise_px", noise_px, 0, 100,
             "Standard deviation of a bead's centre per axis; 0: measured by the residuals");
  }
};

/// One view as calibrated.
struct CalibratedView {
  std::string name;
  Pose T_camera_phantom = Pose::Identity();
  std::vector<SeenBead> beads;
  Eigen::Matrix2Xd residuals_px;  ///< Projected less seen, one column a bead.
  std::vector<bool> is_outlier;   ///< One a bead.
  double rms_px = 0;              ///< Of both axes together, over the beads that are no outliers.
  bool held_out = false;
  bool left_out = false;  ///< It does not agree with the others.
  /// Of the pose, K's uncertainty included: a change of its translation [m] and a small turn about the camera's axes
  /// [rad]. Absent for a view that took no part.
  std::optional<Matrix6d> covariance;
  Eigen::MatrixXd plate_covariance_mm;  ///< Of the pose (rows) with the plates' shifts [mm]; no columns without plates.
};

/// K with its uncertainty, and where the phantom stood.
struct CameraCalibration {
  CameraFile camera;         ///< At the most used source-detector distance.
  CalibrationRecord record;  ///< Kind "camera"; without inputs, machine and date, which the library does not know.
  std::vector<CalibratedView> views;  ///< In the order they were given.
  double noise_px = 0;                ///< Standard deviation of a bead's centre per axis, as measured.
  /// Of each bead by K, poses and plates without it (to first order), root mean square as residual_rms: a model that
  /// only follows the noise makes it larger.
  double left_out_rms_px = 0;
  PlateShifts plates;  ///< As estimated; none of a phantom of one piece.
};

/// The detector that took the views. Where spacing and distance are known, a focal length that is off them by more than
/// a factor of two is refused: the units are wrong.
struct DetectorOfViews {
  int width_px = 0, height_px = 0;
  std::optional<double> pixel_spacing_m;
  std::optional<DetectorDistortion> distortion = {};  ///< Known, as by a grid's image.
  /// Of each axis' coefficients of a known polynomial, the axes independent; empty: taken as exact.
  Eigen::MatrixXd map_covariance_px2 = {};
  /// The known polynomial may have turned since by an angle that grows with the square of the radius, as an
  /// intensifier's image does in another magnetic field: the angle at the rim is estimated, and is in the result's map.
  bool turns_since_map = false;
};

/// Calibrates a camera from views of one phantom: K, distortion if asked for, K's change with the source-detector
/// distance where views have several, and each view's pose, by bundle adjustment from a closed-form start.
///
/// Throws InputError that names view, bead, value and rule, before solving, for what leaves the answer open or cannot
/// be: too few views or beads, a plane seen at one tilt only, too little depth to tell focal length from depth, views
/// that are mirrored against the phantom, beads that are swapped or do not fit any projection, a bead named twice or
/// not in the phantom, centres off the detector, and, after solving, views that do not share one camera.
///
/// With `plates`, the phantom's plates are shifted too, held by what is known of the shifts.
CameraCalibration calibrateCamera(const BeadPhantom& phantom, const DetectorOfViews& detector,
                                  const std::vector<BeadView>& views, const CameraCalibrationSettings& settings = {},
                                  const PhantomPlates& plates = {});

}  // namespace angio::calibration
