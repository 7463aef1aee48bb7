// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "angio/geometry/carm_deviations.hpp"
#include "angio/geometry/carm_limits.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"

namespace angio::geometry {

/// Beam angles in the patient-based convention of DICOM (0018,1510) and (0018,1511), for a patient head first supine:
/// primary + is LAO (detector towards the patient's left), secondary + is CRA (detector towards the head).
struct ViewAngles {
  double primary_rad = 0;
  double secondary_rad = 0;
};

/// Direction from source to detector, in axes L, P, S (x left, y posterior, z towards the head).
Eigen::Vector3d beamDirection(const ViewAngles& angles);

/// The inverse of beamDirection, for a direction of any length. At secondary = +-90 deg the primary angle is 0 by
/// choice.
ViewAngles viewAnglesOf(const Eigen::Vector3d& beam_direction);

/// Camera axes in L, P, S axes for a view: rows are the image's right, the image's down, and the beam. Head is up.
Eigen::Matrix3d viewRotation(const ViewAngles& angles);

/// Beam and detector angles in the isocentre-based convention of DICOM (0018,9463), (0018,9464) and (0018,9465):
/// against the equipment, whatever the patient's position.
///
/// Axes X, Y, Z of the equipment are the table's left, down and head with all table angles zero. Primary + turns the
/// detector from above towards X, secondary + towards Z, and the detector + turns clockwise as one sees it who looks
/// along it to the source. Source: DICOM PS3.3 C.8.19.6.13.1, PS3.17 Z.2.
struct IsocenterAngles {
  double primary_rad = 0;
  double secondary_rad = 0;
  double detector_rotation_rad = 0;
};

/// How the patient lies on the table, DICOM (0018,5100); the sides of a decubitus position are those that are down.
enum class PatientPosition {
  kHeadFirstSupine,
  kHeadFirstProne,
  kHeadFirstDecubitusLeft,
  kHeadFirstDecubitusRight,
  kFeetFirstSupine,
  kFeetFirstProne,
  kFeetFirstDecubitusLeft,
  kFeetFirstDecubitusRight
};

/// Angles of the table: (0018,9469) + turns its head towards X, (0018,9470) + lifts its head, (0018,9471) + lifts its
/// left. Source: DICOM PS3.3 C.8.19.6.13.1.3, PS3.17 Z.3.
struct TableAngles {
  double horizontal_rotation_rad = 0;
  double head_tilt_rad = 0;
  double cradle_tilt_rad = 0;
};

/// Camera axes in the equipment's axes X, Y, Z: rows are the detector's image's right, its down, and the beam.
Eigen::Matrix3d detectorRotation(const IsocenterAngles& angles);

/// The patient's axes L, P, S in the equipment's axes X, Y, Z: R_isocentre_patient.
Eigen::Matrix3d patientRotation(PatientPosition position, const TableAngles& table = {});

/// The patient-based angles of the same beam; the detector's rotation is not part of them.
ViewAngles viewAnglesOf(const IsocenterAngles& angles, const Eigen::Matrix3d& R_isocenter_patient);

/// The isocentre-based angles of the same beam, with the detector rotated so that the patient's head is up in the
/// image: detectorRotation(result) * R_isocentre_patient = viewRotation(angles).
IsocenterAngles isocenterAnglesOf(const ViewAngles& angles, const Eigen::Matrix3d& R_isocenter_patient);

/// Derivatives of the camera's place by kCArmPoseParameterNames: twists of the camera relative to the patient, in the
/// camera frame, by radian, metre or one.
using CArmPoseJacobian = Eigen::Matrix<double, 6, kCArmPoseParameters>;

/// Geometry of an isocentric C-arm without detector rotation: an ideal one, and how the real one deviates from it.
///
/// Frame `iso`: origin at the isocentre, axes L, P, S of a patient who lies straight on the table. The patient lies on
/// the table, so the table's position moves the patient: p_iso = table + p_iso(table at zero).
struct CArmGeometry {
  double source_isocenter_distance_m = 0.810;
  double source_detector_distance_m = 1.113;  ///< By the encoder.
  double pixel_spacing_m = 0.25355859375e-3;
  int image_width_px = 1024;
  int image_height_px = 1024;

  /// Angle of the gantry's base about the table's vertical axis (an L-arm), fixed while the arm is used: both axes turn
  /// with it. + turns the base's head end towards the patient's left. The patient's axes and the table stay.
  double l_arm_rad = 0;
  CArmDeviations deviations;

  /// Throws InputError that names the field when a length or size is not positive, the detector is nearer than the
  /// isocentre, or a deviation not finite or too large to be one.
  void check() const;

  /// The camera at this source-detector distance.
  XrayCamera camera() const { return camera(source_detector_distance_m); }

  /// The camera at another one [m], by the encoder.
  XrayCamera camera(double encoder_distance_m) const;

  /// Pose of the patient frame (iso with the table at zero) in the camera: T_camera_iso(angles) * Trans(table).
  Pose T_camera_patient(const CArmJoints& joints) const;

  /// The same, and how it changes with the numbers that a calibration estimates.
  Pose T_camera_patient(const CArmJoints& joints, CArmPoseJacobian* J) const;

  /// Jacobian of the camera's velocity relative to the patient, in the camera frame, by joint velocity:
  /// [v; w] = eJe * qdot. ViSP's eJe with the camera as end-effector.
  Eigen::Matrix<double, 6, 5> eJe(const CArmJoints& joints) const;

  /// Joints at which the camera sees along `angles`, in the patient's axes, and `target_patient` (patient frame [m])
  /// lies on the beam at the isocentre's distance from the source. A C-arm that deviates gets there by Newton's steps;
  /// nothing that a C-arm can be is too far for them.
  CArmJoints jointsFor(const ViewAngles& angles, const Eigen::Vector3d& target_patient) const;

  /// All joints that do the same, but for whole turns: the above, and the arm brought over the head or the feet to the
  /// other side, primary + 180 deg and 180 deg - secondary, whose image stands on its head.
  std::vector<CArmJoints> allJointsFor(const ViewAngles& angles, const Eigen::Vector3d& target_patient) const;

  /// Of all these, whole turns included, the joints within range and envelope that are nearest to `near` in time (the
  /// slowest joint's share of its speed); of equals the one with the head up. Nothing when no joints are.
  std::optional<CArmJoints> reachable(const ViewAngles& angles, const Eigen::Vector3d& target_patient,
                                      const CArmLimits& limits, const CArmJoints& near) const;

  /// The numbers of kCArmPoseParameterNames [rad, m, 1].
  Eigen::Matrix<double, kCArmPoseParameters, 1> poseParameters() const;
  void setPoseParameters(const Eigen::Matrix<double, kCArmPoseParameters, 1>& values);

 private:
  CArmJoints refined(CArmJoints joints, const Eigen::Vector3d& beam, const Eigen::Vector3d& target_patient) const;
};

}  // namespace angio::geometry
