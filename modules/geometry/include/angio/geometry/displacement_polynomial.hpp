// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <string>

#include "angio/geometry/namespace.hpp"

namespace angio::geometry {

/// A smooth displacement of the plane: a polynomial of a total degree within the unit circle, continued beyond it along
/// each ray by its tangent, so that what was fitted within does not run away outside. Value and derivative are
/// continuous.
///
/// The terms are products of Legendre polynomials, P_a(x) P_b(y) with a + b up to the order: those of degree 0 first,
/// and of one degree those with the highest a first. Source: Abramowitz and Stegun (1964), section 22.7.
struct DisplacementPolynomial {
  static constexpr int kMaxOrder = 20;

  int order = 0;
  Eigen::Matrix2Xd coefficients_px;  ///< One column a term: x and y; none is no displacement.

  /// How many terms a polynomial of this order has.
  static constexpr Eigen::Index termCount(int order) { return (order + 1) * (order + 2) / 2; }

  /// The terms' values at a point of the unit circle: a row of the equations that a fit solves.
  static Eigen::VectorXd terms(int order, const Eigen::Vector2d& point);

  /// The displacement of a point [px]; `J` is its derivative by the point.
  Eigen::Vector2d at(const Eigen::Vector2d& point, Eigen::Matrix2d* J = nullptr) const;

  /// Throws InputError that names the field for an order beyond 1 to kMaxOrder, another number of coefficients, and
  /// numbers that are not finite.
  void check(const std::string& place) const;
};

}  // namespace angio::geometry
