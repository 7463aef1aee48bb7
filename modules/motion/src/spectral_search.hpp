// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <deque>
#include <optional>
#include <vector>

#include "angio/motion/namespace.hpp"

namespace angio::motion {

/// A measured position, as long as it is remembered.
struct MotionSample {
  double time_s;
  Eigen::Vector3d position;
  Eigen::Matrix3d covariance;
};

/// Index of the first sample from a time on; their number where there is none.
std::size_t firstFrom(const std::deque<MotionSample>& samples, double from_s);

/// Where and how a period is looked for.
struct PeriodSearch {
  double low_hz, high_hz;
  int harmonics;
  double step_hz;
  double min_share;  ///< Of what is not slow, that the period must explain.
  /// Slow or known waves that are let go first: cosine and sine of each, besides a constant, a slope and a curve.
  std::vector<double> known_hz;
};

/// A period, and the amplitude of each harmonic along each axis.
struct FoundPeriod {
  double frequency_hz;
  Eigen::Matrix3Xd amplitude_m;  ///< 3 x harmonics.
  double share;                  ///< Of the variance that it explains.
};

/// The period that explains the samples best by least squares, weighed by their mean covariance; of those that do
/// nearly as well the shortest, since twice a period explains what the period does. Nothing when none explains enough.
std::optional<FoundPeriod> findPeriod(const std::deque<MotionSample>& samples, double from_s,
                                      const PeriodSearch& search);

}  // namespace angio::motion
