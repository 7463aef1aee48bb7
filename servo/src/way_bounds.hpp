// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>

#include "angio/geometry/carm.hpp"
#include "angio/messaging/messages.hpp"
#include "angio/servo/namespace.hpp"

namespace angio::servo {

/// How far a machine is off what its start and its goal span [m].
struct WayExcursion {
  double table_m = 0;   ///< The table, outside the box that the start's and the goal's table positions span.
  double target_m = 0;  ///< The target's distance from its goal, less what it was at the start; negative: nearer.
};

/// Joints at which an arm comes to rest that brakes as hard as it can.
CArmJoints restOf(const CArmState& state, const CArmLimits& limits);

/// Where a way began: the joints, and where the arm would have come to rest from there if it moved already.
struct WayStart {
  CArmJoints joints, rest;

  /// @param now        The present joints. @param goal  Joints at the goal.
  /// @param distance_m Distance of the target from its goal, by joints; as seen now, for the start as for the present.
  WayExcursion excursion(const CArmJoints& now, const CArmJoints& goal,
                         const std::function<double(const CArmJoints&)>& distance_m) const;
};

}  // namespace angio::servo
