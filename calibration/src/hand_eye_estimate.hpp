// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "hand_eye_problem.hpp"

namespace angio::calibration {

/// How many are chosen.
std::size_t count(const PoseChoice& chosen);

/// One estimate over a choice of the poses, from the robust start to the gate and the measured noise.
class HandEyeEstimate {
 public:
  /// Borrows the problem and the settings, for as long as it lives.
  HandEyeEstimate(const HandEyeProblem& problem, const HandEyeSettings& settings, const PoseChoice& among);

  std::size_t minPoses() const { return problem_.mount() == HandEyeMount::kIdentity ? 1 : 3; }
  int parameters() const { return problem_.mount() == HandEyeMount::kIdentity ? 6 : 12; }
  double chi2PerFreedom() const;

  /// Degrees of freedom of so many numbers a pose.
  double freedom(double per_pose) const;

  /// Distance of a pose from its prediction by its covariance.
  double sigmas(std::size_t i) const;

  HandEyeTransforms transforms;
  PoseSigma noise;  ///< Measured, beside what the poses' covariances say; zero when the set says all noise.
  std::vector<Matrix6d> covariances;
  PoseChoice used;  ///< No outliers.

 private:
  void measureRobustly();
  void measure();
  void gate(double factor);

  const HandEyeProblem& problem_;
  const HandEyeSettings& settings_;
  PoseChoice among_;
  double inflation_ = 1;  ///< Of chi^2, where the noise is larger than it is said to be.
};

}  // namespace angio::calibration
