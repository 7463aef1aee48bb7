// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/carm_limits.hpp"
#include "angio/robot/namespace.hpp"

namespace angio::robot {

/// `wanted` [rad/s, m/s], shortened as a whole until no joint exceeds its speed: its direction is kept. Zero when a
/// number is not finite.
CArmJoints withinSpeed(const CArmJoints& wanted, const CArmLimits& limits);

}  // namespace angio::robot
