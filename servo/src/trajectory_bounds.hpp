// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <functional>

#include "angio/geometry/carm.hpp"
#include "angio/servo/namespace.hpp"

namespace angio::servo {

/// How far a machine is off what its start and its goal span [m].
struct TrajectoryExcursion {
  double table_m = 0;   ///< The table, outside the box that the start's and the goal's table positions span.
  double target_m = 0;  ///< The target's distance from its goal, less what it was at the start; negative: nearer.
};

/// Start of a motion: the joints, and where the arm would have come to rest if it had braked there.
struct TrajectoryStart {
  CArmJoints joints, rest;

  /// @param now        The present joints. @param goal  Joints at the goal.
  /// @param distance_m Distance of the target from its goal, by joints; as seen now, for the start as for the present.
  TrajectoryExcursion excursion(const CArmJoints& now, const CArmJoints& goal,
                                const std::function<double(const CArmJoints&)>& distance_m) const {
    const CArmJoints least = joints.cwiseMin(rest).cwiseMin(goal), most = joints.cwiseMax(rest).cwiseMax(goal);
    const CArmJoints outside = (now - most).cwiseMax(least - now).cwiseMax(CArmJoints::Zero());
    return {outside.tail<3>().norm(), distance_m(now) - std::max(distance_m(joints), distance_m(rest))};
  }
};

}  // namespace angio::servo
