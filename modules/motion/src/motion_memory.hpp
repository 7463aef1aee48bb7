// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>
#include <optional>

#include "angio/motion/motion_predictor_settings.hpp"
#include "harmonic_filter.hpp"
#include "prediction_record.hpp"
#include "spectral_search.hpp"

namespace angio::motion {

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
