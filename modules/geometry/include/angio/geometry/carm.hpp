// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"

namespace angio {

/// Joints of a C-arm with its table: primary and secondary angle [rad], table x, y, z [m]; velocities in rad/s, m/s.
using CArmJoints = Eigen::Matrix<double, 5, 1>;
constexpr int kCArmJointCount = 5;

/// Beam angles in the patient-based convention of DICOM (0018,1510) and (0018,1511), for a patient head first supine:
/// primary + is LAO (detector towards the patient's left), secondary + is CRA (detector towards the head).
struct ViewAngles {
  double primary_rad = 0;
  double secondary_rad = 0;
};

/// Direction from source to detector, in axes L, P, S (x left, y posterior, z towards the head).
Eigen::Vector3d beamDirection(const ViewAngles& angles);

/// The inverse of beamDirection, for a direction of any length. At secondary = +-90 deg the primary angle is 0 by choice.
ViewAngles viewAnglesOf(const Eigen::Vector3d& beam_direction);

/// Camera axes in L, P, S axes for a view: rows are the image's right, the image's down, and the beam. Head is up.
Eigen::Matrix3d viewRotation(const ViewAngles& angles);

/// Geometry of an isocentric C-arm without detector rotation.
///
/// Frame `iso`: origin at the isocentre, axes L, P, S of a patient who lies straight on the table. The patient lies on the
/// table, so the table's position moves the patient: p_iso = table + p_iso(table at zero).
struct CArmGeometry {
  double source_isocentre_distance_m = 0.810;
  double source_detector_distance_m = 1.113;
  double pixel_spacing_m = 0.25355859375e-3;
  int image_width_px = 1024;
  int image_height_px = 1024;

  /// Throws InputError that names the field when a length or size is not positive, or the detector is nearer than the
  /// isocentre.
  void check() const;

  /// The camera at this source-detector distance.
  XrayCamera camera() const;

  /// Pose of the patient frame (iso with the table at zero) in the camera: T_camera_iso(angles) * Trans(table).
  Pose T_camera_patient(const CArmJoints& joints) const;

  /// Jacobian of the camera's velocity relative to the patient, in the camera frame, by joint velocity:
  /// [v; w] = eJe * qdot. ViSP's eJe with the camera as end-effector.
  Eigen::Matrix<double, 6, 5> eJe(const CArmJoints& joints) const;

  /// Joints at which the camera sees along `angles` and `target_patient` (patient frame [m]) lies at the isocentre.
  CArmJoints jointsFor(const ViewAngles& angles, const Eigen::Vector3d& target_patient) const;
};

/// Range, speed and acceleration of each joint, in the order and units of CArmJoints.
struct CArmLimits {
  CArmJoints lower, upper, velocity, acceleration;

  /// A fast floor-mounted C-arm: +-120 deg / +-60 deg, 25 deg/s and 40 deg/s^2; table +-0.3 m, 0.1 m/s and 0.2 m/s^2.
  static CArmLimits typical();
};

}  // namespace angio
