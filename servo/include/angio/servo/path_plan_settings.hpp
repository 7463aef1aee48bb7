// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/servo/namespace.hpp"

namespace angio::servo {

/// How a joint follows a predicted path: the first step of a plan over the next periods.
struct PathPlanSettings {
  static constexpr int periods_ahead =
      8;                                 ///< Over which a command is planned, as far as the motion is predicted at all.
  double acceleration_share = 0.9;       ///< Of the joints' acceleration and jerk, that plans use.
  static constexpr double effort = 0.3;  ///< Weight of changes of velocity against distances: against following noise.

  void visit(SettingsVisitor& v) { v.number("acceleration_share", acceleration_share, 0.01, 1); }
};

}  // namespace angio::servo
