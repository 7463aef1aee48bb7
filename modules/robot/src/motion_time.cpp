// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/robot/motion_time.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"

namespace angio::robot {
namespace {

// Of one joint over a distance d > 0, with speed v, acceleration a, jerk j.
double doubleS_s(double d, double v, double a, double j) {
  const bool full_acceleration = v * j >= a * a;
  const double to_speed_s = full_acceleration ? a / j + v / a : 2 * std::sqrt(v / j);
  const double cruise_s = d / v - to_speed_s;
  if (cruise_s >= 0) return cruise_s + 2 * to_speed_s;
  if (d < 2 * a * a * a / (j * j)) return 4 * std::cbrt(d / (2 * j));
  // With full acceleration, without reaching the speed: d = a (t - a / j) t, for t from rest to the highest speed.
  const double half_s = 0.5 * a / j;
  return 2 * (half_s + std::sqrt(half_s * half_s + d / a));
}

}  // namespace

double minTime_s(const CArmJoints& from, const CArmJoints& to, const CArmLimits& limits) {
  double slowest_s = 0;
  for (int i = 0; i < kCArmJointCount; ++i) {
    const double distance = std::abs(to[i] - from[i]);
    if (distance == 0) continue;
    slowest_s = std::max(slowest_s, doubleS_s(distance, limits.velocity[i], limits.acceleration[i], limits.jerk[i]));
  }
  return slowest_s;
}

CArmJoints withinSpeed(const CArmJoints& wanted, const CArmLimits& limits) {
  if (!wanted.allFinite() || !limits.velocity.allFinite()) return CArmJoints::Zero();
  double factor = 1;
  for (int i = 0; i < kCArmJointCount; ++i) {
    const double most = std::max(limits.velocity[i], 0.0);
    if (std::abs(wanted[i]) > most) factor = std::min(factor, most / std::abs(wanted[i]));
  }
  return factor * wanted;
}

void checkJoints(const CArmLimits& limits) {
  for (int i = 0; i < kCArmJointCount; ++i) {
    const std::string joint = "[" + std::to_string(i) + "]";
    requireFinite("c-arm limits", "lower" + joint, limits.lower[i]);
    requireFinite("c-arm limits", "upper" + joint, limits.upper[i]);
    requirePositive("c-arm limits", "velocity" + joint, limits.velocity[i]);
    requirePositive("c-arm limits", "acceleration" + joint, limits.acceleration[i]);
    if (limits.lower[i] > limits.upper[i]) {
      throw InputError("c-arm limits", "lower" + joint, formatValue(limits.lower[i]), "must not exceed upper" + joint);
    }
  }
}

}  // namespace angio::robot
