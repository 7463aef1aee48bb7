// SPDX-License-Identifier: GPL-2.0-or-later
#include "carm_path.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace angio::robot {
namespace {

// The highest rate at which `left` is used up without using more, when each step of dt_s may take fall * dt_s off the
// rate: the highest acceleration from which a joint comes to a speed, by its jerk.
//
// In units of fall dt and fall dt^2: from rate v it takes n = ceil(v) steps, v + (v - 1) + ... = n v - n (n - 1) / 2
// long. The continuous sqrt(2 fall left) alone would step over the end.
double fallingRate(double left, double fall, double dt_s) {
  if (left <= 0 || fall <= 0) return 0;
  const double d = left / (fall * dt_s * dt_s);
  const double n = std::max(1.0, std::ceil(0.5 * (std::sqrt(1 + 8 * d) - 1)));
  const double in_steps = fall * dt_s * (d / n + 0.5 * (n - 1));
  return std::min(std::sqrt(2 * fall * left), in_steps);  // In this order: steps too short to count give NaN.
}

}  // namespace

double velocityAfter(double start, double commanded, double acceleration, double time_s) {
  const double change = commanded - start, most = acceleration * time_s;
  return start + std::clamp(change, -most, most);
}

double wayAfter(double start, double commanded, double acceleration, double time_s) {
  const double change = commanded - start;
  const double ramp_s = std::min(time_s, std::abs(change) / acceleration);
  const double reached = velocityAfter(start, commanded, acceleration, ramp_s);
  return 0.5 * (start + reached) * ramp_s + reached * (time_s - ramp_s);
}

double stepTowards(double u, double a0, double goal, double acceleration, double jerk, double dt_s) {
  const double left = goal - u;
  const double a = std::copysign(std::min(acceleration, fallingRate(std::abs(left), jerk, dt_s)), left);
  const double within_jerk = std::clamp(a, a0 - jerk * dt_s, a0 + jerk * dt_s);
  return u + std::clamp(within_jerk, -acceleration, acceleration) * dt_s;
}

// While braking, normal . way is a sum of parabolas that end one after the other: its highest point lies at an end, or
// where its slope crosses zero in between.
double furthest(const CArmJoints& normal, const CArmJoints& velocity, const CArmJoints& acceleration) {
  std::array<double, kCArmJointCount + 1> ends_s{};  // The first is 0.
  for (int i = 0; i < kCArmJointCount; ++i) {
    ends_s[static_cast<std::size_t>(i) + 1] = normal[i] == 0 ? 0 : std::abs(velocity[i]) / acceleration[i];
  }
  std::sort(ends_s.begin(), ends_s.end());
  const auto slopeAt = [&](double t) {
    double slope = 0;
    for (int i = 0; i < kCArmJointCount; ++i) {
      slope += normal[i] * std::copysign(std::max(0.0, std::abs(velocity[i]) - acceleration[i] * t), velocity[i]);
    }
    return slope;
  };
  double way = 0, most = 0, slope = slopeAt(0);
  for (std::size_t k = 1; k < ends_s.size(); ++k) {
    const double lasts_s = ends_s[k] - ends_s[k - 1];
    if (lasts_s <= 0) continue;
    const double next = slopeAt(ends_s[k]);
    if (slope > 0 && next < 0) most = std::max(most, way + 0.5 * slope * slope * lasts_s / (slope - next));
    way += 0.5 * (slope + next) * lasts_s;
    most = std::max(most, way);
    slope = next;
  }
  return most;
}

}  // namespace angio::robot
