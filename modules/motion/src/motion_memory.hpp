// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>

#include "angio/motion/motion_predictor_settings.hpp"
#include "harmonic_filter.hpp"
#include "spectral_search.hpp"

namespace angio::motion {

/// Scores one method of prediction: its past predictions against what was measured then.
class PredictionRecord {
 public:
  /// @param scoring_memory_s  Time constant of the error by which the methods are compared; that of a covariance is
  /// three times as long.
  /// @param horizon_s         Horizon of the predictions.
  /// @param first_error_m     What the covariances are taken to lack before anything has been scored.
  PredictionRecord(double scoring_memory_s, double horizon_s, double first_error_m)
      : scoring_memory_s_(scoring_memory_s),
        horizon_s_(horizon_s),
        lacking_(first_error_m * first_error_m * Eigen::Matrix3d::Identity()) {}

  /// A prediction for a later time, to be scored then.
  void add(double time_s, const PositionEstimate& estimate) { open_.push_back({time_s, estimate}); }

  /// Scores the predictions for times up to a measurement's. Those between two measurements are compared with the
  /// straight line between them.
  void score(double last_time_s, const Eigen::Vector3d& last_position, double time_s, const Eigen::Vector3d& position,
             const Eigen::Matrix3d& R);

  /// Drops the predictions that are still to be scored: those from before a shift do not contain it.
  void forgetOpen() { open_.clear(); }

  bool scored() const { return weight_ > 0; }

  /// Mean squared error, in units of the measurement's noise, lately; infinite before anything has been scored.
  double error() const;

  /// The covariance with what it has been found to lack: as much up to the horizon of the predictions, more beyond it.
  Eigen::Matrix3d honest(const Eigen::Matrix3d& covariance, double horizon_s) const;

 private:
  struct Prediction {
    double time_s;
    PositionEstimate estimate;
  };
  double scoring_memory_s_, horizon_s_;
  std::deque<Prediction> open_;
  double error_sum_ = 0, weight_ = 0;
  Eigen::Matrix3d lacking_;  // Mean of error error^T - P - R: with eigenvalues that may be negative.
};

/// A harmonic filter with the record of its predictions.
struct HarmonicMotion {
  HarmonicFilter filter;
  PredictionRecord record;
  int breathing = -1, heart = -1;  // The filter's oscillators; -1: not found.

  /// Corrects the filter, which is at the sample's time, scores old predictions and adds a new one.
  void take(const MotionSample& last, const MotionSample& sample, double scoring_horizon_s);
};

/// The periods that are in the samples from a time on: breathing, heart, both or none.
std::vector<Oscillator> findPeriods(const std::deque<MotionSample>& samples, double from_s,
                                    const MotionPredictorSettings& settings);

/// A filter of these periods that has been over the samples from a time on, of which there must be one.
HarmonicMotion learnt(const std::deque<MotionSample>& samples, double from_s, const std::vector<Oscillator>& periods,
                      const MotionPredictorSettings& settings);

}  // namespace angio::motion
