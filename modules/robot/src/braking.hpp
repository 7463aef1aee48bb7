// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <cmath>

namespace angio {

/// The highest rate at which `left` is used up without using more, when each step of dt_s may take fall * dt_s off the
/// rate: the highest speed from which a joint stops within a distance, by its acceleration; the highest acceleration
/// from which it comes to a speed, by its jerk.
///
/// In units of fall dt and fall dt^2: from rate v it takes n = ceil(v) steps, v + (v - 1) + ... = n v - n (n - 1) / 2
/// long. The continuous sqrt(2 fall left) alone would step over the end.
inline double fallingRate(double left, double fall, double dt_s) {
  if (left <= 0 || fall <= 0) return 0;
  const double d = left / (fall * dt_s * dt_s);
  const double n = std::max(1.0, std::ceil(0.5 * (std::sqrt(1 + 8 * d) - 1)));
  const double in_steps = fall * dt_s * (d / n + 0.5 * (n - 1));
  return std::min(std::sqrt(2 * fall * left), in_steps);  // In this order: steps too short to count give NaN.
}

}  // namespace angio
