// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

#include "angio/rod/namespace.hpp"

namespace angio::rod {

/// A discrete rod as it stands: a line of n points, n - 1 edges, each edge with a direction across it that is drawn on
/// the rod (its material frame). The first two points and the first edge's frame are held: there it comes in.
///
/// Free are, in this order and edge by edge from the second one on, the edge's turn about itself and its end point:
/// 4 (n - 2) numbers.
struct RodShape {
  Eigen::Matrix3Xd points;     ///< 3 x n [m].
  Eigen::Matrix3Xd directors;  ///< 3 x (n - 1), each of length 1 and normal to its edge.
  Eigen::VectorXd twists;      ///< n, of the frames against each other at each inner point [rad], not wrapped.
  Eigen::VectorXd turned;      ///< n - 1, how far each edge was turned about itself, all moves added up [rad].

  Eigen::Index size() const { return points.cols(); }
  Eigen::Index freedoms() const { return 4 * (size() - 2); }
  Eigen::Vector3d edge(Eigen::Index j) const { return points.col(j + 1) - points.col(j); }

  static Eigen::Index turnOf(Eigen::Index edge) { return 4 * (edge - 1); }         ///< Place of its turn, edge >= 1.
  static Eigen::Index placeOf(Eigen::Index point) { return 4 * (point - 2) + 1; }  ///< Place of its three, point >= 2.
};

/// A rod without twist along 3 x n `points` [m]. `across`: about where the first edge's director points.
RodShape untwistedRod(const Eigen::Matrix3Xd& points, const Eigen::Vector3d& across);

/// The shape whose freedoms have moved by `step`. Directors are carried along in time as their edges turn (Bergou et
/// al. 2010, section 4.1), then turned about them.
RodShape moved(const RodShape& shape, const Eigen::VectorXd& step);

/// The shape whose first edge was turned about itself by `angle_rad`, clockwise as seen from its start.
RodShape rolled(const RodShape& shape, double angle_rad);

/// `v` turned as the unit vector `from` is turned to `to` the shortest way.
Eigen::Vector3d carried(const Eigen::Vector3d& v, const Eigen::Vector3d& from, const Eigen::Vector3d& to);

}  // namespace angio::rod
