// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/servo/namespace.hpp"

namespace angio::servo {

/// How fast a law takes its error away: the error decays as exp(-lambda t) while no limit binds. lambda may grow
/// towards the goal (ViSP's vpAdaptiveGain), where it no longer asks for more than the arm can do:
///
///     lambda(x) = lambda_per_s + (lambda_at_goal_per_s - lambda_per_s) exp(-x / gain_change_deg)
///
/// with x the angle between the beams plus the angle under which the source sees the target's error, so that the same
/// numbers mean the same for every law.
struct ServoGain {
  double lambda_per_s = 1.5;        ///< Far from the goal.
  double lambda_at_goal_per_s = 3;  ///< At the goal.
  double gain_change_deg = 3;

  void visit(SettingsVisitor& v) {
    v.number("lambda_per_s", lambda_per_s, 0.01, 20);
    v.number("lambda_at_goal_per_s", lambda_at_goal_per_s, 0.01, 20);
    v.number("gain_change_deg", gain_change_deg, 1e-3, 180);
  }
};

}  // namespace angio::servo
