// SPDX-License-Identifier: GPL-2.0-or-later
#include "way_bounds.hpp"

#include <algorithm>

namespace angio::servo {

CArmJoints restOf(const CArmState& state, const CArmLimits& limits) {
  const Eigen::Array<double, kCArmJointCount, 1> v = state.velocity.array();
  return (state.joints.array() + 0.5 * v * v.abs() / limits.acceleration.array()).matrix();
}

WayExcursion WayStart::excursion(const CArmJoints& now, const CArmJoints& goal,
                                 const std::function<double(const CArmJoints&)>& distance_m) const {
  const CArmJoints least = joints.cwiseMin(rest).cwiseMin(goal), most = joints.cwiseMax(rest).cwiseMax(goal);
  const CArmJoints outside = (now - most).cwiseMax(least - now).cwiseMax(CArmJoints::Zero());
  return {outside.tail<3>().norm(), distance_m(now) - std::max(distance_m(joints), distance_m(rest))};
}

}  // namespace angio::servo
