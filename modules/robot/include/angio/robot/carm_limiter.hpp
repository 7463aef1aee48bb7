// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/carm.hpp"

namespace angio {

/// `wanted` [rad/s, m/s], shortened as a whole until no joint exceeds its speed: its direction is kept. Zero when a
/// number is not finite.
CArmJoints withinSpeed(const CArmJoints& wanted, const CArmLimits& limits);

/// The joint velocity [rad/s, m/s] to command for the next `dt_s` seconds, when `wanted` is asked for. In this order:
///
/// 1. Speed: withinSpeed(wanted).
/// 2. Acceleration: the change from `current_velocity` is shortened as a whole until no joint exceeds its acceleration.
/// 3. Ends: a joint moves towards the end of its range no faster than it can brake from with its acceleration in steps
/// of dt_s,
///    which is below sqrt(2 a distance), and not at all at the end or beyond it; away from the end it is free. This
///    comes before the acceleration when both cannot be had.
///
/// All zero when a number in any argument, `limits` included, is not finite, or dt_s is not positive.
CArmJoints limited(const CArmJoints& wanted, const CArmJoints& current_velocity, const CArmJoints& joints,
                   const CArmLimits& limits, double dt_s);

}  // namespace angio
