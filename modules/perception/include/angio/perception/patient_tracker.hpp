// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "angio/geometry/carm.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/motion/motion_predictor.hpp"
#include "angio/perception/namespace.hpp"
#include "angio/registration/registration.hpp"
#include "angio/types/carm_motion.hpp"

namespace angio::perception {

/// Where the camera was when a frame was exposed, as far as its machine knows.
struct CameraPlace {
  std::int64_t time_us = 0;  ///< Of the exposure [us].
  Pose T_camera_patient = Pose::Identity();
};

/// What is believed of T_dsa_cb: the calibration at first, then what registrations of trusted frames say.
///
/// The joints say where the camera is, so all that a frame can teach is how the patient lies: one small, slow unknown.
/// With `follow_motion` the place of the tree's centroid is a quick one as well, which breathes.
struct PatientTrackerSettings {
  double calibration_rotation_std_deg = 2;
  double calibration_translation_std_mm = 6;
  static constexpr double tracking_rotation_std_deg = 0.7;  ///< Between two frames, once a frame has been trusted.
  static constexpr double tracking_translation_std_mm = 3;
  double memory_frames = 8;  ///< Trusted frames that are averaged over; 1: only the newest counts.
  int frames_until_lost = 3;

  // `memory_frames` is of the rotation alone with it. Tasks for a patient who moves, centre and hold, want it.
  bool follow_motion = false;
  MotionPredictorSettings motion;

  double max_deformation_mm = 4;

  /// Of the calibrated pose's twist about the tree's centroid, as PosePrior has it.
  Matrix6d calibrationCovariance() const;

  void visit(SettingsVisitor& v) {
    v.number("calibration_rotation_std_deg", calibration_rotation_std_deg, 1e-3, 90,
             "Standard deviation of the calibration's rotation, per axis: how far a first registration may look");
    v.number("calibration_translation_std_mm", calibration_translation_std_mm, 1e-3, 1000,
             "Standard deviation of the calibration's translation, per axis: how far a first registration may look");
    v.integer("frames_until_lost", frames_until_lost, 1, 1000,
              "Untrusted frames in a row after which the search is wide again");
    v.flag("follow_motion", follow_motion,
           "The next frame is looked for where the centroid's motion is predicted to be, and not where it has been on "
           "average");
    v.section("motion", [this](SettingsVisitor& fields) { motion.visit(fields); });
    v.number("max_deformation_mm", max_deformation_mm, 0, 100,
             "With follow_motion: largest deformation (rms over the tree) by which a frame that the rigid tree "
             "explains only in part may still be trusted; 0: not tried");
    v.fixed("memory_frames", memory_frames, 1, 1000);
  }
};

/// Keeps what is believed of T_dsa_cb, and says by it and the joints where the tree is in a frame.
class PatientTracker {
 public:
  /// @param T_dsa_cb  Calibrated: the model frame in the patient frame (C-arm frame with the table at zero).
  PatientTracker(const PatientTrackerSettings& settings, const CArmGeometry& carm, const Pose& T_dsa_cb,
                 const Eigen::Vector3d& centroid_model);

  /// Whether a trusted frame has been seen lately: the search can be narrow.
  bool tracking() const { return tracking_; }

  /// Where the model should be seen with these joints, and how surely.
  PosePrior predict(const CArmJoints& joints) const;

  /// The same at the time of a frame, whose camera's place or joints these are: with `follow_motion` at the place that
  /// is predicted for then.
  PosePrior predict(const CameraPlace& place) const;
  PosePrior predict(const CArmState& state) const { return predict(placeOf(state)); }

  /// A trusted registration of a frame.
  ///
  /// @param covariance       Of the pose, as RegistrationResult has it; nothing: taken for 1 mm.
  /// @param shared_depth_m2  Variance of the tree's place along the beam that all frames share, as that of a
  /// deformation [m^2]. Frames do not average it out: the calibration keeps its weight against all of them together.
  void update(const Pose& T_camera_model, const CameraPlace& place, const std::optional<Matrix6d>& covariance,
              double shared_depth_m2 = 0);

  /// A frame that could not be trusted.
  void miss();

  /// Learns how the patient moves, from what it was told: MotionPredictor::learn().
  void learn();

  const Pose& T_dsa_cb() const { return T_dsa_cb_; }

  /// Where these joints have the camera.
  CameraPlace placeOf(const CArmState& state) const { return {state.time_us, carm_.T_camera_patient(state.joints)}; }

 private:
  PosePrior predict(const Pose& T_camera_patient) const;
  double sinceFirst_s(std::int64_t time_us) const;

  PatientTrackerSettings settings_;
  CArmGeometry carm_;
  Pose T_dsa_cb_;
  Eigen::Vector3d centroid_;             // Model frame.
  Eigen::Vector3d calibrated_centroid_;  // Patient frame.
  bool tracking_ = false;
  int trusted_in_a_row_ = 0;
  int missed_in_a_row_ = 0;
  std::optional<MotionPredictor> motion_;  // Of the centroid in the patient frame, seconds from `first_us_`.
  std::optional<std::int64_t> first_us_;
};

}  // namespace angio::perception
