// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/registration/start_settings.hpp"
#include "pose_prior_term.hpp"

namespace angio::registration {

/// Poses that a search begins at: the belief's own first, then draws around it. One seed, one row of draws.
class StartDraws {
 public:
  /// Normal with the belief's covariance, or even in the box that is to be searched.
  std::vector<Pose> poses(const PosePriorTerm& belief, const StartSettings& starts, int count);

  /// The same rotations and depths, all where the belief is in the plane: for a search that tries every shift.
  std::vector<Pose> withoutShift(const PosePriorTerm& belief, const StartSettings& starts, int count);

 private:
  std::vector<Vector6d> unit_draws_;  // Drawn once: seeding an engine costs more than a step.
  int seed_ = 0;
};

/// How far shifts are to be searched [m]: to the box's side, or so many standard deviations of the belief.
double shiftReach_m(const PosePriorTerm& belief, const StartSettings& starts, double standard_deviations);

}  // namespace angio::registration
