// SPDX-License-Identifier: GPL-2.0-or-later
#include <cmath>
#include <limits>

#include "angio/geometry/carm.hpp"

namespace angio::geometry {
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
  other[0] += deviations.primary_offset_rad;
  other[1] += deviations.secondary_offset_rad;
  other[0] = std::remainder(other[0] + kPi, 2 * kPi);
  other[1] = std::remainder(kPi - other[1], 2 * kPi);
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
