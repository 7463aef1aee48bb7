// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/calibration/bead_detection.hpp"
#include "angio/calibration/bead_phantom.hpp"
#include "angio/calibration/camera_calibration.hpp"
#include "angio/calibration/pose_set.hpp"
#include "angio/calibration_records/record.hpp"
#include "angio/geometry/carm.hpp"

namespace angio::calibration {

/// What is known of the camera before: its values at one source-detector distance by the encoder, and how surely. The
/// pixel spacing and the distance must be given.
struct GeometryCamera : XrayCamera::Parameters {
  std::optional<Eigen::Matrix4d> covariance;  ///< Of fx, fy, cx, cy [px^2]; absent: they are held.
  Eigen::Vector2d principal_point_slope_px_per_m = Eigen::Vector2d::Zero();  ///< By the distance; known beforehand.
};

/// Whether the bending of the arm is estimated.
enum class FlexModel { kNone, kLowOrder };

/// What a calibration of the C-arm's geometry estimates, and where its search starts.
struct GeometrySettings {
  FlexModel flex = FlexModel::kLowOrder;
  static constexpr double flex_std_mm = 0.3;  ///< How much an arm bends: where the search for it starts.
  static constexpr double flex_std_deg = 0.03;
  double source_isocenter_distance_mm = 780;
  double pose_scatter_mm = 0.3;  ///< Where the search for what joints do not explain starts, each axis.
  double pose_scatter_deg = 0.03;
  static constexpr double outlier_std = 4;          ///< Beads further off than this do not count.
  static constexpr double outlier_view_factor = 4;  ///< Views that are worse than the usual by this do not count.
  static constexpr double max_offset_deg = 3;  ///< How far a C-arm may be from ideal before it is doubted, each angle,
  static constexpr double max_offset_mm = 15;  ///< and each length.

  void visit(SettingsVisitor& v) {
    v.choice("flex", flex, {"none", "low_order"}, "Model of how the C-arm bends");
    v.number("source_isocentre_distance_mm", source_isocenter_distance_mm, 100, 5000,
             "Distance from source to isocentre where the search starts");
    v.fixed("pose_scatter_mm", pose_scatter_mm, 1e-4, 20);
    v.fixed("pose_scatter_deg", pose_scatter_deg, 1e-5, 5);
  }
};

/// One view against the calibrated arm.
struct GeometryViewFit {
  std::string name;
  CArmJoints joints = CArmJoints::Zero();  ///< By the encoders [rad, m].
  double residual = 0;                     ///< In the record's residual_unit.
  Twist miss = Twist::Zero();  ///< Where the arm has the phantom's middle less where it was seen [m], and its turn
                               ///< [rad], camera axes.
  bool held_out = false;
  bool left_out = false;  ///< It does not agree with the others.
};

/// A C-arm's geometry from views of what lies on its table: a phantom, or a patient.
struct GeometryCalibration {
  CArmGeometry carm;
  Pose T_patient_phantom = Pose::Identity();        ///< Where it lay, table at zero.
  CalibrationRecord record;                         ///< Kind "geometry"; machine, date and inputs are the caller's.
  std::vector<GeometryViewFit> views;               ///< In the order they were given.
  std::vector<std::string> kept;                    ///< What the views cannot tell and stays as it was, in words.
  std::optional<double> bead_std_px;                ///< Measured: of a bead about its own view's best pose.
  double pose_scatter_m = 0, pose_scatter_rad = 0;  ///< What joints do not explain of a view's pose, each axis.
  double rms_without_flex = 0;                      ///< Residual over all used views of the rigid arm alone.
  std::vector<std::string> doubts;  ///< What a user should know: views left out, beads that lie elsewhere.
};

/// Calibrates how a C-arm moves its camera from pinhole views: distortion is taken out before.
///
/// Each view is condensed first: the pose of the phantom that explains its beads best by robust least squares, with the
/// information about it and its coupling to the camera's four numbers, which is exact to second order in the pose's
/// error. Over these the deviations, the camera (by its prior), the phantom's place and the bending (by its ridge) are
/// solved for with Cauchy's loss, and again without views that it leaves out. What joints do not explain scatters the
/// poses; its two standard deviations, of translation and rotation, and the bending's two, are found by restricted
/// maximum likelihood, so that the bending is as strong as the views say and the covariance covers encoder noise and
/// bending that the model does not have.
///
/// Throws InputError, named `place`, before anything is solved: fewer than 6 different positions, angles that span too
/// little for the primary axis, a view with fewer than 8 beads, beads that no pose explains (mirrored phantom, wrong
/// units, labels that are swapped, which are named), or, after the first fit, views of which a quarter or more are of
/// another C-arm (which are named). What the positions cannot tell is kept and listed in `kept`.
GeometryCalibration calibrateGeometry(const std::string& place, const BeadPhantom& phantom,
                                      const GeometryCamera& camera, const std::vector<BeadView>& views,
                                      const GeometrySettings& settings = {});

/// The same from registered views: poses of one model, the patient's or a phantom's, with the angles they were taken
/// at. They enter by their covariances (the set's camera_std where there is none, or their own scatter where neither
/// is given); its record's residuals are those of the model's middle [mm], and held out ones those of each sixth of the
/// views by the other five. What poses cannot tell, the camera and its source-detector distance, is kept from `camera`,
/// and listed. T_base_hand is not used.
///
/// Throws InputError, named by the set's file: a pose without angles, what checkPoseSet refuses, and as above.
GeometryCalibration calibrateGeometry(const PoseSet& set, const GeometryCamera& camera,
                                      const GeometrySettings& settings = {});

/// All that calibrateGeometry wants, from files: views of a phantom, or registered poses.
struct GeometryInput {
  std::string path;
  BeadPhantom phantom;
  std::vector<BeadView> views;
  std::optional<PoseSet> poses;  ///< In place of phantom and views.
  GeometryCamera camera;
  std::string machine;
  std::vector<CalibrationRecord> records;  ///< The camera's own.
  std::vector<CalibrationInput> inputs;    ///< View set, phantom, camera, views; or pose set and camera.
};

/// Reads the camera's file and a view set (readViewSet), its phantom and images or tables, or, where the file has
/// `poses` and no `views`, a pose set (readPoseSet); beads lose the camera's distortion. Throws InputError that names
/// file, view, key, value and rule: what the readers refuse, a view without angles, a camera of another image size,
/// without pixel spacing or source-detector distance.
/// Shadows in images of an intensifier may be stretched. `tell` is called after each view with how many of how many
/// are done.
GeometryInput readGeometryInput(const std::string& views_path, const std::string& camera_path,
                                const BeadDetectionSettings& detection = {},
                                const std::function<void(int done, int total)>& tell = {});

/// The one of both calibrateGeometry that takes such an input.
GeometryCalibration calibrateGeometry(const GeometryInput& input, const GeometrySettings& settings = {});

}  // namespace angio::calibration
