// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/patient_tracker.hpp"

#include <algorithm>

namespace angio {

PatientTracker::PatientTracker(const PatientTrackerSettings& settings, const CArmGeometry& carm, const Pose& T_dsa_cb,
                               const Eigen::Vector3d& centroid_model)
    : settings_(settings), carm_(carm), T_dsa_cb_(T_dsa_cb), centroid_(centroid_model) {
  checkSettings("tracker", settings_);
  carm_.check();
}

PosePrior PatientTracker::predict(const CArmJoints& joints) const {
  const double translation_mm =
      tracking_ ? settings_.tracking_translation_std_mm : settings_.calibration_translation_std_mm;
  const double rotation_deg = tracking_ ? settings_.tracking_rotation_std_deg : settings_.calibration_rotation_std_deg;
  Vector6d std_deviation;
  std_deviation << Eigen::Vector3d::Constant(translation_mm * 1e-3), Eigen::Vector3d::Constant(degToRad(rotation_deg));
  PosePrior prior;
  prior.T_camera_model = carm_.T_camera_patient(joints) * T_dsa_cb_;
  prior.covariance = Matrix6d(std_deviation.cwiseAbs2().asDiagonal());
  return prior;
}

void PatientTracker::update(const Pose& T_camera_model, const CArmJoints& joints) {
  const Pose seen = carm_.T_camera_patient(joints).inverse() * T_camera_model;
  ++trusted_in_a_row_;
  missed_in_a_row_ = 0;
  // A plain mean at first, then one that forgets. About the centroid, where translation and rotation are least
  // entangled.
  const double gain = tracking_ ? std::max(1.0 / trusted_in_a_row_, 1.0 / settings_.memory_frames) : 1.0;
  const Eigen::Translation3d to_centroid(centroid_);
  const Twist correction = logSE3(to_centroid.inverse() * T_dsa_cb_.inverse() * seen * to_centroid);
  T_dsa_cb_ = T_dsa_cb_ * to_centroid * expSE3(gain * correction) * to_centroid.inverse();
  T_dsa_cb_.linear() = nearestRotation(T_dsa_cb_.linear());
  tracking_ = true;
}

void PatientTracker::miss() {
  if (++missed_in_a_row_ < settings_.frames_until_lost) return;
  tracking_ = false;
  trusted_in_a_row_ = 0;
}

}  // namespace angio
