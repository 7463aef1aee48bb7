// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/robot/within_speed.hpp"

#include <algorithm>
#include <cmath>

namespace angio::robot {

CArmJoints withinSpeed(const CArmJoints& wanted, const CArmLimits& limits) {
  if (!wanted.allFinite() || !limits.velocity.allFinite()) return CArmJoints::Zero();
  double factor = 1;
  for (int i = 0; i < kCArmJointCount; ++i) {
    const double most = std::max(limits.velocity[i], 0.0);
    if (std::abs(wanted[i]) > most) factor = std::min(factor, most / std::abs(wanted[i]));
  }
  return factor * wanted;
}

}  // namespace angio::robot
