// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>

#include "angio/geometry/carm_limits.hpp"
#include "angio/servo/task_settings.hpp"

namespace angio::servo {

/// A predicted place whose standard deviation is less than this counts almost fully in a path.
inline constexpr double kSure_m = 0.5e-3;

/// Where joints should be after each of the next periods.
class JointPaths {
 public:
  static constexpr int kMaxPoints = 16;

  /// @param places  After one more period, from where the joints are now [rad, m].
  /// @param weight  How much that matters.
  void add(const CArmJoints& places, double weight);

  int size() const { return size_; }
  double place(int joint, int k) const { return places_[static_cast<std::size_t>(k)][joint]; }
  double weight(int k) const { return weights_[static_cast<std::size_t>(k)]; }

 private:
  std::array<CArmJoints, kMaxPoints> places_;
  std::array<double, kMaxPoints> weights_;
  int size_ = 0;
};

/// How joints move now [rad/s, m/s].
struct JointsMotion {
  CArmJoints velocity;
  CArmJoints last_change;  ///< Of the velocity from the last period to this one.
};

/// The joints' velocities over the next period with which they follow their paths best over all their points, within
/// acceleration and jerk: what they can not follow they go through the middle of, and a far point they come to rest at.
/// Each joint by itself; zero without points.
///
/// Constrained least squares by descent along single changes of velocity and along all changes from one on, the first
/// step of a receding horizon. A sum of squares would shoot over what lies further off than its horizon: a joint comes
/// in no faster, against the path's own speed, than it can brake.
CArmJoints followingVelocity(const JointPaths& paths, const JointsMotion& motion, const CArmLimits& limits,
                             const PathPlanSettings& settings, double period_s);

}  // namespace angio::servo
