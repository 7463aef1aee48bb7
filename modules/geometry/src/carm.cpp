// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/carm.hpp"

#include <cmath>
#include <limits>

namespace angio::geometry {

Eigen::Vector3d beamDirection(const ViewAngles& angles) {
  const double ca = std::cos(angles.primary_rad), sa = std::sin(angles.primary_rad);
  const double cb = std::cos(angles.secondary_rad), sb = std::sin(angles.secondary_rad);
  return {sa * cb, -ca * cb, sb};
}

ViewAngles viewAnglesOf(const Eigen::Vector3d& beam_direction) {
  const Eigen::Vector3d d = beam_direction.normalized();
  const double level = std::hypot(d.x(), d.y());
  return {level < 1e-12 ? 0.0 : std::atan2(d.x(), -d.y()), std::atan2(d.z(), level)};
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
  // Left and posterior of the patient in the table's axes, in the order of PatientPosition.
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY();
  const Eigen::Vector3d axes[8][2] = {{x, y}, {-x, -y}, {y, -x}, {-y, x}, {-x, y}, {x, -y}, {y, x}, {-y, -x}};
  const auto& [left, posterior] = axes[static_cast<int>(position)];
  Eigen::Matrix3d R_table_patient;
  R_table_patient << left, posterior, left.cross(posterior);
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

namespace {

// Head up before head down where both are as near.
constexpr double kHeadDownCost_s = 1e-6;

double timeBetween(const CArmJoints& a, const CArmJoints& b, const CArmLimits& limits) {
  return (a - b).cwiseAbs().cwiseQuotient(limits.velocity).maxCoeff();
}

}  // namespace

CArmJoints CArmGeometry::jointsFor(const ViewAngles& angles, const Eigen::Vector3d& target_patient) const {
  CArmJoints joints;
  joints << angles.primary_rad, angles.secondary_rad, -target_patient;
  if (l_arm_rad != 0) {
    // The arm's angles are counted from axes that the L-arm has turned.
    const Eigen::Vector3d beam_gantry = Eigen::AngleAxisd(-l_arm_rad, Eigen::Vector3d::UnitY()) * beamDirection(angles);
    const ViewAngles turned = viewAnglesOf(beam_gantry);
    joints[0] = turned.primary_rad;
    joints[1] = turned.secondary_rad;
  }
  return refined(joints, beamDirection(angles), target_patient);
}

std::vector<CArmJoints> CArmGeometry::allJointsFor(const ViewAngles& angles,
                                                   const Eigen::Vector3d& target_patient) const {
  const CArmJoints upright = jointsFor(angles, target_patient);
  // One beam has two pairs of angles: (a, b) and (a + 180 deg, 180 deg - b).
  CArmJoints other = upright;
  other[0] = std::remainder(upright[0] + deviations.primary_offset_rad + kPi, 2 * kPi);
  other[1] = std::remainder(kPi - (upright[1] + deviations.secondary_offset_rad), 2 * kPi);
  return {upright, refined(other, beamDirection(angles), target_patient)};
}

std::optional<CArmJoints> CArmGeometry::reachable(const ViewAngles& angles, const Eigen::Vector3d& target_patient,
                                                  const CArmLimits& limits, const CArmJoints& near) const {
  std::optional<CArmJoints> best;
  double best_s = std::numeric_limits<double>::infinity(), extra_s = 0;
  for (const CArmJoints& solution : allJointsFor(angles, target_patient)) {
    for (const int primary_turns : {0, -1, 1}) {
      for (const int secondary_turns : {0, -1, 1}) {
        CArmJoints joints = solution;
        joints[0] += primary_turns * 2 * kPi;
        joints[1] += secondary_turns * 2 * kPi;
        const bool within = (joints.array() >= limits.lower.array()).all() &&
                            (joints.array() <= limits.upper.array()).all() && !limits.envelope.violated(joints);
        const double time_s = timeBetween(joints, near, limits) + extra_s;
        if (!within || !(time_s < best_s)) continue;
        best = joints;
        best_s = time_s;
      }
    }
    extra_s = kHeadDownCost_s;
  }
  return best;
}

// Newton's steps from angles that an ideal arm would have; an ideal arm is there already.
CArmJoints CArmGeometry::refined(CArmJoints joints, const Eigen::Vector3d& beam,
                                 const Eigen::Vector3d& target_patient) const {
  if (!deviations.movesCamera()) return joints;
  joints[0] -= deviations.primary_offset_rad;
  joints[1] -= deviations.secondary_offset_rad;
  const Eigen::Vector3d goal(0, 0, source_isocenter_distance_m);
  double last_error = std::numeric_limits<double>::infinity();
  CArmJoints best = joints;
  for (int step = 0; step < 30; ++step) {
    const Pose T = T_camera_patient(joints);
    const Eigen::Vector3d beam_camera = T.linear() * beam, target = T * target_patient;
    Eigen::Matrix<double, 5, 1> error;
    error << beam_camera.head<2>(), target - goal;
    if (!(error.norm() < last_error)) break;
    last_error = error.norm();
    best = joints;
    // A turn w of the camera moves the beam's image by w x z, a move v and a turn w the target by -v - w x target.
    const auto J = eJe(joints);
    Eigen::Matrix<double, 5, 5> A;
    A.row(0) = J.row(4);
    A.row(1) = -J.row(3);
    A.bottomRows<3>() = J.topRows<3>() - skew(target) * J.bottomRows<3>();
    joints += A.fullPivLu().solve(error);
  }
  return best;
}

}  // namespace angio::geometry
