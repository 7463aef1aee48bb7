// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/rod/rod_shape.hpp"
#include "banded_system.hpp"

namespace angio::rod {

/// A point of a rod that the wall presses on, and where it was before it moved.
struct SlidingPoint {
  Eigen::Index point = 2;
  Eigen::Vector3d from = Eigen::Vector3d::Zero();      ///< Where it was [m].
  Eigen::Vector3d outward = Eigen::Vector3d::UnitX();  ///< Towards the wall, length 1.
  Eigen::Vector3d along = Eigen::Vector3d::UnitZ();    ///< The rod's direction, length 1.
  double bound_n = 0;                                  ///< Largest friction: the coefficient times the wall's force.
};

/// Coulomb friction as an incremental potential [J]: what sliding has cost since the rod was at `from`, where the
/// wall's forces are held at what they were. A surface slides along the wall as its point moves and as the rod of
/// `radius_m` has turned about itself (RodShape::turned), so that a rod that slides along has little to hold its turn.
/// Up to some micrometres the force grows with the way, as in M. Li et al., Incremental potential contact, ACM
/// Transactions on Graphics 39(4), 2020.
///
/// Adds to `gradient` the exact first derivatives, to `hessian` the exact second ones; both may be null.
double slidingEnergy(const RodShape& shape, const std::vector<SlidingPoint>& points, double radius_m,
                     Eigen::VectorXd* gradient, BandedSystem* hessian);

/// The force of friction on such a point [N].
Eigen::Vector3d friction_n(const RodShape& shape, const SlidingPoint& sliding, double radius_m);

}  // namespace angio::rod
