// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>

#include "angio/motion/motion_predictor_settings.hpp"
#include "harmonic_filter.hpp"
#include "spectral_search.hpp"

namespace angio::motion {

/// How one way to predict has done: its past predictions against what was measured then.
class PredictionRecord {
 public:
  /// @param judged_over_s    Time constant of the error by which the ways are compared; a covariance takes three times
  /// that.
  /// @param horizon_s        At which the promises are made.
  /// @param first_error_m    What the covariances are taken to lack before anything has been judged.
  PredictionRecord(double judged_over_s, double horizon_s, double first_error_m)
      : judged_over_s_(judged_over_s),
        horizon_s_(horizon_s),
        lacking_(first_error_m * first_error_m * Eigen::Matrix3d::Identity()) {}

  /// A prediction that will be judged when its time has come.
  void promise(double time_s, const PositionEstimate& estimate) { open_.push_back({time_s, estimate}); }

  /// Judges what was promised for times up to a measurement's, of which the ones between two measurements are held
  /// against the straight line between them.
  void judge(double last_time_s, const Eigen::Vector3d& last_position, double time_s, const Eigen::Vector3d& position,
             const Eigen::Matrix3d& R);

  /// Promises that were made before a shift would be judged by what they could not know.
  void forgetOpen() { open_.clear(); }

  bool judged() const { return weight_ > 0; }

  /// Mean squared error, in units of the measurement's noise, lately; infinite before anything has been judged.
  double error() const;

  /// The covariance with what it has been found to lack: as much up to the horizon of the promises, more beyond it.
  Eigen::Matrix3d honest(const Eigen::Matrix3d& covariance, double horizon_s) const;

 private:
  struct Promise {
    double time_s;
    PositionEstimate estimate;
  };
  double judged_over_s_, horizon_s_;
  std::deque<Promise> open_;
  double error_sum_ = 0, weight_ = 0;
  Eigen::Matrix3d lacking_;  // Mean of error error^T - P - R: with eigenvalues that may be negative.
};

/// A harmonic filter with the record of its predictions.
struct HarmonicMotion {
  HarmonicFilter filter;
  PredictionRecord record;
  int breathing = -1, heart = -1;  // The filter's oscillators; -1: not found.

  /// Corrects the filter, which is at the sample's time, and judges and promises.
  void take(const MotionSample& last, const MotionSample& sample, double judged_horizon_s);
};

/// The periods that are in the samples from a time on: breathing, heart, both or none.
std::vector<Oscillator> findPeriods(const std::deque<MotionSample>& samples, double from_s,
                                    const MotionPredictorSettings& settings);

/// A filter of these periods that has been over the samples from a time on, of which there must be one.
HarmonicMotion learnt(const std::deque<MotionSample>& samples, double from_s, const std::vector<Oscillator>& periods,
                      const MotionPredictorSettings& settings);

}  // namespace angio::motion
