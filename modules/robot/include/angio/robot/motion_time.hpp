// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/carm_limits.hpp"
#include "angio/robot/namespace.hpp"

namespace angio::robot {

/// The shortest time [s] in which the joints get from rest at `from` to rest at `to` under the limits of speed,
/// acceleration and jerk: what no law can beat. The slowest joint's; range and envelope are not asked.
///
/// Source: Biagiotti & Melchiorri, Trajectory Planning for Automatic Machines (2008), section 3.4 (double S).
double minTime_s(const CArmJoints& from, const CArmJoints& to, const CArmLimits& limits);

/// `wanted` [rad/s, m/s], shortened as a whole until no joint exceeds its speed: its direction is kept. Zero when a
/// number is not finite.
CArmJoints withinSpeed(const CArmJoints& wanted, const CArmLimits& limits);

/// Throws InputError that names the joint's limit when a range is empty or not finite, or a speed or an acceleration
/// not positive.
void checkJoints(const CArmLimits& limits);

}  // namespace angio::robot
