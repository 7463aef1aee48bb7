// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/desired_view.hpp"

#include <cmath>

namespace angio::servo {

Pose desiredPose(const DesiredView& view, double source_isocenter_distance_m) {
  Pose T = Pose::Identity();
  T.linear() = viewRotation(view.angles) * view.R_lps_model;
  T.translation() = Eigen::Vector3d(0, 0, source_isocenter_distance_m) - T.linear() * view.target_model;
  return T;
}

ViewError viewError(const Pose& T_camera_model, const Pose& desired_T_camera_model,
                    const Eigen::Vector3d& target_model) {
  const Eigen::Matrix3d R = T_camera_model.linear(), Rd = desired_T_camera_model.linear();
  const Eigen::Vector3d beam = R.row(2).transpose(), desired_beam = Rd.row(2).transpose();
  ViewError error;
  error.direction_rad = std::atan2(beam.cross(desired_beam).norm(), beam.dot(desired_beam));
  // Roll is what is left of the rotation once the beams are brought together along the shortest rotation.
  const Eigen::Matrix3d aligned = R * Eigen::Quaterniond::FromTwoVectors(desired_beam, beam).toRotationMatrix();
  error.roll_rad = rotationAngle(aligned * Rd.transpose());
  error.target_m = (T_camera_model * target_model - desired_T_camera_model * target_model).norm();
  return error;
}

}  // namespace angio::servo
