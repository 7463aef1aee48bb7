// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/patient_tracker.hpp"

#include <algorithm>
#include <cmath>

#include "angio/perception/patient_observation.hpp"

namespace angio::perception {
namespace {

Matrix6d evenCovariance(double translation_mm, double rotation_deg) {
  Vector6d std_deviation;
  std_deviation << Eigen::Vector3d::Constant(translation_mm * 1e-3), Eigen::Vector3d::Constant(degToRad(rotation_deg));
  return std_deviation.cwiseAbs2().asDiagonal();
}

}  // namespace

Matrix6d PatientTrackerSettings::calibrationCovariance() const {
  return evenCovariance(calibration_translation_std_mm, calibration_rotation_std_deg);
}

PatientTracker::PatientTracker(const PatientTrackerSettings& settings, const CArmGeometry& carm, const Pose& T_dsa_cb,
                               const Eigen::Vector3d& centroid_model)
    : settings_(settings),
      carm_(carm),
      T_dsa_cb_(T_dsa_cb),
      centroid_(centroid_model),
      calibrated_centroid_(T_dsa_cb * centroid_model) {
  checkSettings("tracker", settings_);
  carm_.check();
  if (settings_.follow_motion) motion_.emplace(settings_.motion);
}

// The difference of times that may be anything: a clock that jumps is refused by the predictor.
double PatientTracker::sinceFirst_s(std::int64_t time_us) const {
  return 1e-6 * (static_cast<double>(time_us) - static_cast<double>(first_us_.value_or(time_us)));
}

PosePrior PatientTracker::predict(const CArmJoints& joints) const { return predict(carm_.T_camera_patient(joints)); }

PosePrior PatientTracker::predict(const Pose& T_camera_patient) const {
  PosePrior prior;
  prior.T_camera_model = T_camera_patient * T_dsa_cb_;
  prior.covariance = tracking_ ? evenCovariance(PatientTrackerSettings::tracking_translation_std_mm,
                                                PatientTrackerSettings::tracking_rotation_std_deg)
                               : settings_.calibrationCovariance();
  return prior;
}

PosePrior PatientTracker::predict(const CameraPlace& place) const {
  PosePrior prior = predict(place.T_camera_patient);
  if (!motion_ || !tracking_) return prior;
  const auto centroid = motion_->predict(sinceFirst_s(place.time_us));
  if (!centroid) return prior;
  Pose T_dsa_cb = T_dsa_cb_;
  T_dsa_cb.translation() = centroid->position - T_dsa_cb.linear() * centroid_;
  prior.T_camera_model = place.T_camera_patient * T_dsa_cb;
  return prior;
}

void PatientTracker::update(const Pose& T_camera_model, const CameraPlace& place,
                            const std::optional<Matrix6d>& covariance, double shared_depth_m2) {
  const Pose T_patient_camera = place.T_camera_patient.inverse();
  Pose seen = T_patient_camera * T_camera_model;
  // A frame is fitted about what the frames before it have said: a depth that each of them draws a little the same way,
  // and none can see, would wander without an end.
  const double calibrated_m2 = std::pow(1e-3 * settings_.calibration_translation_std_mm, 2);
  const Eigen::Vector3d beam = T_patient_camera.linear().col(2);
  const double off_m = beam.dot(seen * centroid_ - calibrated_centroid_);
  const Eigen::Vector3d back_m = shared_depth_m2 / (shared_depth_m2 + calibrated_m2) * off_m * beam;
  seen.pretranslate(-back_m);
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
  if (!motion_) return;
  if (!first_us_) first_us_ = place.time_us;
  const Eigen::Matrix3d R = T_patient_camera.linear();
  const Eigen::Matrix3d spread = covariance
                                     ? PatientObservation{T_camera_model, *covariance}.pointCovariance(centroid_, R)
                                     : Eigen::Matrix3d(1e-6 * Eigen::Matrix3d::Identity());
  // What the predictor leaves out or refuses it predicts without: a trusted frame is one all the same.
  static_cast<void>(
      motion_->update(sinceFirst_s(place.time_us), T_patient_camera * (T_camera_model * centroid_) - back_m, spread));
}

void PatientTracker::miss() {
  if (++missed_in_a_row_ < settings_.frames_until_lost) return;
  tracking_ = false;
  trusted_in_a_row_ = 0;
}

void PatientTracker::learn() {
  if (motion_) motion_->learn();
}

}  // namespace angio::perception
