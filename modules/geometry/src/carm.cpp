// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/carm.hpp"

#include <algorithm>
#include <cmath>

namespace angio::geometry {

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

Eigen::Matrix3d detectorRotation(const IsocenterAngles& angles) {
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

ViewAngles viewAnglesOf(const IsocenterAngles& angles, const Eigen::Matrix3d& R_isocenter_patient) {
  return viewAnglesOf(R_isocenter_patient.transpose() *
                      beamDirection(ViewAngles{angles.primary_rad, angles.secondary_rad}));
}

IsocenterAngles isocenterAnglesOf(const ViewAngles& angles, const Eigen::Matrix3d& R_isocenter_patient) {
  const Eigen::Matrix3d R_camera_isocenter = viewRotation(angles) * R_isocenter_patient.transpose();
  const ViewAngles beam = viewAnglesOf(Eigen::Vector3d(R_camera_isocenter.row(2).transpose()));
  const Eigen::Matrix3d turn = R_camera_isocenter * viewRotation(beam).transpose();
  return {beam.primary_rad, beam.secondary_rad, std::atan2(turn(1, 0), turn(0, 0))};
}

}  // namespace angio::geometry
