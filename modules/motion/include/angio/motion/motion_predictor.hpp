// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>

#include "angio/motion/motion_predictor_settings.hpp"

namespace angio::motion {

/// How a position ahead of the last measurement is reckoned.
enum class MotionModel {
  kHeld,      ///< It stays where it is.
  kVelocity,  ///< It goes on as it goes.
  kHarmonic,  ///< Resting position, drift, breathing and heartbeat.
};

/// Where a point will be.
struct [[nodiscard]] MotionPrediction {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();    ///< [m], frame of the measurements.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< Of the true position there and then [m^2].
  MotionModel model = MotionModel::kHeld;
  bool beyond_horizon = false;  ///< So far ahead that nothing is predicted: the last estimate, less and less sure.
};

/// What became of a measurement.
enum class MotionStatus {
  kTaken,
  kSuspect,  ///< Too far from what was expected: left out, until the next one says the same.
  kChanged,  ///< Taken, and the motion is no longer what it was: part of what was learnt has been let go.
  kRefused,  ///< Not a number, no covariance, or not later than the last one, unless several in a row are not: then the
             ///< clock was set back, and everything begins anew.
};

/// Whether a measurement was taken, and why not.
struct [[nodiscard]] MotionUpdate {
  MotionStatus status = MotionStatus::kTaken;
  std::string reason;  ///< In words; empty when taken.
};

/// Predicts where a point of a breathing patient will be, from where it has been.
///
/// Three models run side by side, and the one whose recent predictions were best is used: the last position, kept (best
/// for what wanders at random); constant velocity; and a harmonic Kalman filter of resting position, drift and two
/// oscillators, breathing and heartbeat, with harmonics, whose frequencies are found in the memory by least squares and
/// followed by the filter. Oscillators are driven by noise, after the state space form of a quasi-periodic Gaussian
/// process. Source: Solin & Saerkkae, Explicit link between periodic covariance functions and state space models,
/// AISTATS 2014. Covariances are mended by what past predictions' errors were against theirs.
///
/// Knows no clock; the same measurements give the same predictions, bit for bit.
class MotionPredictor {
 public:
  /// Throws InputError when a setting is out of its range or a band is empty.
  explicit MotionPredictor(const MotionPredictorSettings& settings = {});
  MotionPredictor(MotionPredictor&&) noexcept;
  MotionPredictor& operator=(MotionPredictor&&) noexcept;
  ~MotionPredictor();

  /// Takes a measured position in.
  ///
  /// @param time_s      Rises from call to call; steps may differ and measurements may be missing.
  /// @param position_m  In a frame that is not accelerated itself. @param covariance_m2  Of its error.
  MotionUpdate update(double time_s, const Eigen::Vector3d& position_m, const Eigen::Matrix3d& covariance_m2);

  /// Looks for periods in what has been measured, where some are missing and it is time to: at most once a second of
  /// the measurements, some milliseconds then. Without it nothing is ever predicted to oscillate. Apart from update()
  /// because a prediction that somebody waits for need not wait for this: call it when that is out.
  void learn();

  /// Where the point will be at a time from the last measurement on; nothing before the first measurement, for an
  /// earlier time, or for one that is no number.
  std::optional<MotionPrediction> predict(double time_s) const;

  /// The same by one of the models; nothing either when that one has not learnt enough yet.
  std::optional<MotionPrediction> predict(double time_s, MotionModel model) const;

  std::optional<double> breathing_hz() const;  ///< As followed; nothing before it has been found.
  std::optional<double> heart_hz() const;

  /// Forgets everything.
  void reset();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace angio::motion
