// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/robot/carm_limiter.hpp"

#include <algorithm>
#include <cmath>

#include "braking.hpp"

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
    v[i] = std::min(v[i], fallingRate(limits.upper[i] - joints[i], limits.acceleration[i], dt_s));
    v[i] = std::max(v[i], -fallingRate(joints[i] - limits.lower[i], limits.acceleration[i], dt_s));
  }
  return v;
}

}  // namespace angio
