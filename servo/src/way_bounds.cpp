// SPDX-License-Identifier: GPL-2.0-or-later
#include "way_bounds.hpp"

#include <algorithm>

namespace angio::servo {

CArmJoints restOf(const CArmState& state, const CArmLimits& limits) {
  const Eigen::Array<double, kCArmJointCount, 1> v = state.velocity.array();
  return (state.joints.array() + 0.5 * v * v.abs() / limits.acceleration.array()).matrix();
}

WayExcursion WayStart::excursion(const CArmJoints& joints, const CArmJoints& goal,
                                 const std::function<double(const CArmJoints&)>& distance_m) const {
  const CArmJoints least = from_.cwiseMin(rest_).cwiseMin(goal), most = from_.cwiseMax(rest_).cwiseMax(goal);
  const CArmJoints outside = (joints - most).cwiseMax(least - joints).cwiseMax(CArmJoints::Zero());
  return {outside.tail<3>().norm(), distance_m(joints) - std::max(distance_m(from_), distance_m(rest_))};
}

}  // namespace angio::servo
