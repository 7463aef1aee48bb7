// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/carm_limits.hpp"
#include "angio/robot/namespace.hpp"

namespace angio::robot {

/// The velocity after `time_s` of a joint that follows a command with its acceleration.
double velocityAfter(double start, double commanded, double acceleration, double time_s);

/// How far it gets in that time.
double wayAfter(double start, double commanded, double acceleration, double time_s);

/// One step of dt_s from velocity `u` and acceleration `a0` towards velocity `goal`, within acceleration and jerk, such
/// that it comes to the goal without shooting over.
double stepTowards(double u, double a0, double goal, double acceleration, double jerk, double dt_s);

/// How much further than now normal . joints gets at most if the arm, which moves at `velocity`, brakes, each joint
/// with its own acceleration: one that was on its way out may stop later than one that was on its way in. Never
/// negative.
double furthest(const CArmJoints& normal, const CArmJoints& velocity, const CArmJoints& acceleration);

}  // namespace angio::robot
