// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/robot/carm_limiter.hpp"

#include <algorithm>
#include <cmath>

namespace angio {
namespace {

// The largest factor in [0, 1] by which no entry of v exceeds its bound.
double shortening(const CArmJoints& v, const CArmJoints& bound) {
  double factor = 1;
  for (int i = 0; i < kCArmJointCount; ++i) {
    const double most = std::max(bound[i], 0.0);
    if (std::abs(v[i]) > most) factor = std::min(factor, most / std::abs(v[i]));
  }
  return factor;
}

// The highest speed from which a joint stops within `distance` when each step of dt may take a dt off its speed. In
// units of a dt and a dt^2: from speed v it takes n = ceil(v) steps, v + (v - 1) + ... = n v - n (n - 1) / 2 long. The
// continuous sqrt(2 a d) alone would step over the end.
double brakingSpeed(double distance, double acceleration, double dt_s) {
  if (distance <= 0 || acceleration <= 0) return 0;
  const double d = distance / (acceleration * dt_s * dt_s);
  const double n = std::max(1.0, std::ceil(0.5 * (std::sqrt(1 + 8 * d) - 1)));
  const double in_steps = acceleration * dt_s * (d / n + 0.5 * (n - 1));
  return std::min(std::sqrt(2 * acceleration * distance),
                  in_steps);  // In this order: steps too short to count give NaN.
}

bool finite(const CArmLimits& limits) {
  return limits.lower.allFinite() && limits.upper.allFinite() && limits.velocity.allFinite() &&
         limits.acceleration.allFinite();
}

}  // namespace

CArmJoints withinSpeed(const CArmJoints& wanted, const CArmLimits& limits) {
  if (!wanted.allFinite() || !limits.velocity.allFinite()) return CArmJoints::Zero();
  return shortening(wanted, limits.velocity) * wanted;
}

CArmJoints limited(const CArmJoints& wanted, const CArmJoints& current_velocity, const CArmJoints& joints,
                   const CArmLimits& limits, double dt_s) {
  const bool sound = wanted.allFinite() && current_velocity.allFinite() && joints.allFinite() && finite(limits) &&
                     std::isfinite(dt_s) && dt_s > 0;
  if (!sound) return CArmJoints::Zero();
  const CArmJoints change = withinSpeed(wanted, limits) - current_velocity;
  CArmJoints v = current_velocity + shortening(change, limits.acceleration * dt_s) * change;
  for (int i = 0; i < kCArmJointCount; ++i) {
    v[i] = std::min(v[i], brakingSpeed(limits.upper[i] - joints[i], limits.acceleration[i], dt_s));
    v[i] = std::max(v[i], -brakingSpeed(joints[i] - limits.lower[i], limits.acceleration[i], dt_s));
  }
  return v;
}

}  // namespace angio
