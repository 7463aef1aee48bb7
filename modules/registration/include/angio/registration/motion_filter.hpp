// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/base/settings.hpp"
#include "angio/registration/registration.hpp"

namespace angio::registration {

/// From RegistrationResult's covariance (t; rotation in camera axes) to PosePrior's (twist about the centroid, model
/// axes), both of the same uncertainty of `T_camera_model`, to first order. They may be singular.
Matrix6d covarianceAboutCentroid(const Matrix6d& of_result, const Pose& T_camera_model,
                                 const Eigen::Vector3d& centroid_model);

/// The way back: from PosePrior's covariance to RegistrationResult's.
Matrix6d covarianceOfResult(const Matrix6d& about_centroid, const Pose& T_camera_model,
                            const Eigen::Vector3d& centroid_model);

/// How a tree moves between frames, and how well a registration knows where it is.
///
/// The defaults are those of breathing. A sine of 15 mm over 4 s has a largest speed of 15 mm 2 pi / 4 s = 24 mm/s (1.6
/// mm from frame to frame at 15 Hz) and a largest acceleration of 15 mm (2 pi / 4 s)^2 = 37 mm/s^2; of 2 deg: 3.1 deg/s
/// and 4.9 deg/s^2. Breath is not white: its acceleration keeps its sign for 2 s, and a filter that takes it for white
/// lags behind by b = a dt^2 / beta, beta the gain on the velocity. With a white acceleration as strong as the largest
/// true one and 0.5 mm of measurement noise, beta is 0.23: b is 0.7 mm at most where the predicted deviation is 0.6 mm,
/// so that the lag stays within what the covariance says, on average over a breath.
struct MotionFilterSettings {
  double acceleration_std_mm_per_s2 = 40;  ///< Per axis, of its mean over `acceleration_mean_s`.
  static constexpr double angular_acceleration_std_deg_per_s2 = 6;  ///< Per axis.
  double acceleration_mean_s = 1.0 / 15;  ///< Density of the white acceleration: its variance times this.
  static constexpr double first_speed_std_mm_per_s = 25;  ///< What may be expected of a first frame, per axis.
  static constexpr double first_angular_speed_std_deg_per_s = 4;

  /// Added to what a registration says of itself, which takes image points as independent and knows no wrong matches.
  static constexpr double measured_translation_std_mm = 0.3;
  static constexpr double measured_rotation_std_deg = 0.15;

  void visit(SettingsVisitor& v) {
    v.number("acceleration_std_mm_per_s2", acceleration_std_mm_per_s2, 1e-3, 1e6);
    v.number("acceleration_mean_s", acceleration_mean_s, 1e-4, 100);
  }
};

/// How far a measured pose lies from the predicted one.
struct Innovation {
  /// 99.9 % of the chi-square distribution with six degrees of freedom.
  static constexpr double kGate = 22.458;

  Twist xi = Twist::Zero();        ///< From the predicted to the measured pose, as PosePrior's [m; rad].
  double squared_mahalanobis = 0;  ///< xi^T S^-1 xi, S the covariance of both; 6 on average.

  bool insideGate() const { return squared_mahalanobis <= kGate; }
};

/// Kalman filter on SE(3) for a tree that moves with constant velocity and white acceleration.
///
/// State: S = T_camera_model Trans(c), c the tree's centroid, and its twist V in model axes, dS/dt = S V^. Error state:
/// S_true = S exp(xi), V_true = V + nu, so that xi is PosePrior's. Source: Barfoot, State Estimation for Robotics
/// (2017), chapters 7 and 8, here with perturbations on the right.
///
/// Any frame that is not accelerated itself may stand for the camera's. Where the C-arm moves, that is the patient's.
class MotionFilter {
 public:
  /// Throws InputError when a setting is out of its range or the centroid is not finite.
  MotionFilter(const MotionFilterSettings& settings, const Eigen::Vector3d& centroid_model);

  /// Where the tree is to be expected, and how surely; nothing before the first update. Throws InputError when the time
  /// is before the last update's.
  std::optional<PosePrior> predict(double time_s) const;

  /// How far a measurement lies from the prediction, which it leaves as it is; nothing before the first update.
  ///
  /// @param about_centroid  The measurement's covariance as PosePrior has it; the settings' floor is added here.
  std::optional<Innovation> innovation(const Pose& T_camera_model, const Matrix6d& about_centroid, double time_s) const;

  /// Takes a measurement in, also one outside the gate: what to do with that is the caller's to say. The first one
  /// begins the motion. Throws InputError when something is not finite, or the time is before the last update's.
  std::optional<Innovation> update(const Pose& T_camera_model, const Matrix6d& about_centroid, double time_s);

  /// Forgets everything: the next update is a first one.
  void reset() { state_.reset(); }

 private:
  using Matrix12d = Eigen::Matrix<double, 12, 12>;
  struct State {
    double time_s = 0;
    Pose T_camera_centered = Pose::Identity();
    Twist velocity = Twist::Zero();            // Per second.
    Matrix12d covariance = Matrix12d::Zero();  // Of [xi; nu].
  };

  State at(double time_s) const;
  Matrix6d measured(const Matrix6d& about_centroid) const;
  Innovation innovation(const State& predicted, const Pose& T_camera_model, const Matrix6d& about_centroid) const;

  MotionFilterSettings settings_;
  Eigen::Vector3d centroid_;
  std::optional<State> state_;
};

}  // namespace angio::registration
