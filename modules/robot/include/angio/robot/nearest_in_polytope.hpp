// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/carm_limits.hpp"
#include "angio/robot/namespace.hpp"

namespace angio::robot {

/// Half-spaces normals.row(k) . x <= bounds[k], at most kMaxCount of them, so that nothing is allocated.
struct Polytope {
  static constexpr int kMaxCount = 48;
  Eigen::Matrix<double, Eigen::Dynamic, kCArmJointCount, Eigen::RowMajor, kMaxCount, kCArmJointCount> normals;
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxCount, 1> bounds;
  int size() const { return static_cast<int>(bounds.size()); }
};

/// The point of the polytope that is nearest to `wanted`: the quadratic programme min |x - wanted|^2.
///
/// `inside` is any point of the polytope, where the search starts; every step stays in the polytope, so that the result
/// does even if the steps run out. Source: Nocedal & Wright, Numerical Optimization (2006), algorithm 16.3 (primal
/// active set), with Bland's rule against cycles.
CArmJoints nearestInPolytope(const CArmJoints& wanted, const Polytope& polytope, const CArmJoints& inside);

}  // namespace angio::robot
