// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/carm.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"

namespace angio {

Eigen::Vector3d beamDirection(const ViewAngles& angles) {
  const double ca = std::cos(angles.primary_rad), sa = std::sin(angles.primary_rad);
  const double cb = std::cos(angles.secondary_rad), sb = std::sin(angles.secondary_rad);
  return {sa * cb, -ca * cb, sb};
}

ViewAngles viewAnglesOf(const Eigen::Vector3d& beam_direction) {
  const Eigen::Vector3d d = beam_direction.normalized();
  const double level = std::hypot(d.x(), d.y());
  ViewAngles angles;
  angles.primary_rad = level < 1e-12 ? 0.0 : std::atan2(d.x(), -d.y());
  angles.secondary_rad = std::atan2(d.z(), level);
  return angles;
}

Eigen::Matrix3d viewRotation(const ViewAngles& angles) {
  const Eigen::Vector3d beam = beamDirection(angles);
  const Eigen::Vector3d right(-std::cos(angles.primary_rad), -std::sin(angles.primary_rad), 0);
  Eigen::Matrix3d R;
  R << right.transpose(), beam.cross(right).transpose(), beam.transpose();
  return R;
}

Eigen::Matrix3d detectorRotation(const IsocentreAngles& angles) {
  // At zero the equipment's axes are the patient's, so that only the detector's turn is new.
  return Eigen::AngleAxisd(angles.detector_rotation_rad, Eigen::Vector3d::UnitZ()) *
         viewRotation(ViewAngles{angles.primary_rad, angles.secondary_rad});
}

Eigen::Matrix3d patientRotation(PatientPosition position, const TableAngles& table) {
  const auto axes = [](const Eigen::Vector3d& left, const Eigen::Vector3d& posterior) {
    Eigen::Matrix3d R_table_patient;
    R_table_patient << left, posterior, left.cross(posterior);
    return R_table_patient;
  };
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY();
  Eigen::Matrix3d R_table_patient;
  switch (position) {
    case PatientPosition::kHeadFirstSupine:
      R_table_patient = axes(x, y);
      break;
    case PatientPosition::kHeadFirstProne:
      R_table_patient = axes(-x, -y);
      break;
    case PatientPosition::kHeadFirstDecubitusLeft:
      R_table_patient = axes(y, -x);
      break;
    case PatientPosition::kHeadFirstDecubitusRight:
      R_table_patient = axes(-y, x);
      break;
    case PatientPosition::kFeetFirstSupine:
      R_table_patient = axes(-x, y);
      break;
    case PatientPosition::kFeetFirstProne:
      R_table_patient = axes(x, -y);
      break;
    case PatientPosition::kFeetFirstDecubitusLeft:
      R_table_patient = axes(y, x);
      break;
    case PatientPosition::kFeetFirstDecubitusRight:
      R_table_patient = axes(-y, -x);
      break;
  }
  // PS3.17 eq. Z.3-1 gives p_iso = (R3 R2 R1)^T p_table: turns about the vertical, the table's x and its z.
  return Eigen::AngleAxisd(table.horizontal_rotation_rad, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(table.head_tilt_rad, Eigen::Vector3d::UnitX()) *
         Eigen::AngleAxisd(-table.cradle_tilt_rad, Eigen::Vector3d::UnitZ()) * R_table_patient;
}

ViewAngles viewAnglesOf(const IsocentreAngles& angles, const Eigen::Matrix3d& R_isocentre_patient) {
  return viewAnglesOf(R_isocentre_patient.transpose() *
                      beamDirection(ViewAngles{angles.primary_rad, angles.secondary_rad}));
}

IsocentreAngles isocentreAnglesOf(const ViewAngles& angles, const Eigen::Matrix3d& R_isocentre_patient) {
  const Eigen::Matrix3d R_camera_isocentre = viewRotation(angles) * R_isocentre_patient.transpose();
  const ViewAngles beam = viewAnglesOf(Eigen::Vector3d(R_camera_isocentre.row(2).transpose()));
  const Eigen::Matrix3d turn = R_camera_isocentre * viewRotation(beam).transpose();
  return {beam.primary_rad, beam.secondary_rad, std::atan2(turn(1, 0), turn(0, 0))};
}

void CArmGeometry::check() const {
  const std::string place = "c-arm";
  requirePositive(place, "source_isocentre_distance_mm", source_isocentre_distance_m * 1e3);
  requirePositive(place, "source_detector_distance_mm", source_detector_distance_m * 1e3);
  if (source_detector_distance_m <= source_isocentre_distance_m) {
    throw InputError(place, "source_detector_distance_mm", shown(source_detector_distance_m * 1e3),
                     "must exceed source_isocentre_distance_mm");
  }
  camera();
}

XrayCamera CArmGeometry::camera() const {
  return XrayCamera::centred(image_width_px, image_height_px, pixel_spacing_m, source_detector_distance_m);
}

Pose CArmGeometry::T_camera_patient(const CArmJoints& joints) const {
  const Eigen::Matrix3d R = viewRotation({joints[0], joints[1]});
  Pose T = Pose::Identity();
  T.linear() = R;
  T.translation() = Eigen::Vector3d(0, 0, source_isocentre_distance_m) + R * joints.tail<3>();
  return T;
}

Eigen::Matrix<double, 6, 5> CArmGeometry::eJe(const CArmJoints& joints) const {
  const Eigen::Matrix3d R = viewRotation({joints[0], joints[1]});
  const double ca = std::cos(joints[0]), sa = std::sin(joints[0]);
  // Primary turns the arm about the patient's long axis; secondary about the axis that primary has turned.
  const Eigen::Vector3d axes_iso[2] = {Eigen::Vector3d::UnitZ(), Eigen::Vector3d(-ca, -sa, 0)};
  const Eigen::Vector3d source_from_isocentre(0, 0, -source_isocentre_distance_m);
  Eigen::Matrix<double, 6, 5> J = Eigen::Matrix<double, 6, 5>::Zero();
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector3d w = R * axes_iso[i];
    J.block<3, 1>(0, i) = w.cross(source_from_isocentre);
    J.block<3, 1>(3, i) = w;
  }
  J.block<3, 3>(0, 2) = -R;  // The table moves the patient; the camera moves the other way relative to the patient.
  return J;
}

CArmJoints CArmGeometry::jointsFor(const ViewAngles& angles, const Eigen::Vector3d& target_patient) const {
  CArmJoints joints;
  joints << angles.primary_rad, angles.secondary_rad, -target_patient;
  return joints;
}

CArmLimits CArmLimits::typical() {
  CArmLimits limits;
  limits.upper << degToRad(120), degToRad(60), 0.3, 0.3, 0.3;
  limits.lower = -limits.upper;
  limits.velocity << degToRad(25), degToRad(25), 0.1, 0.1, 0.1;
  limits.acceleration << degToRad(40), degToRad(40), 0.2, 0.2, 0.2;
  return limits;
}

}  // namespace angio
