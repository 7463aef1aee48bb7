// SPDX-License-Identifier: GPL-2.0-or-later
#include "map_turn.hpp"

#include <algorithm>

#include "angio/base/errors.hpp"

namespace angio::calibration {

DisplacementPolynomial turnOf(const DetectorDistortion& map) {
  if (map.model != DetectorDistortion::Model::kPolynomial) {
    throw InputError("camera calibration", "turns_since_map", "", "needs the map of a grid");
  }
  // r^2 (-y, x) in Legendre polynomials: x^2 y = 2/3 P2(x) P1(y) + 1/3 P1(y), y^3 = 2/5 P3(y) + 3/5 P1(y). Terms of one
  // degree begin with the highest of x: of degree 1 from term 1, of degree 3 from term 6.
  constexpr Eigen::Index kX = 1, kY = 2, kX3 = 6, kX2Y = 7, kXY2 = 8, kY3 = 9;
  DisplacementPolynomial turn;
  turn.order = 3;
  turn.coefficients_px = Eigen::Matrix2Xd::Zero(2, DisplacementPolynomial::termCount(3));
  turn.coefficients_px(0, kX2Y) = -2.0 / 3;
  turn.coefficients_px(0, kY3) = -2.0 / 5;
  turn.coefficients_px(0, kY) = -(1.0 / 3 + 3.0 / 5);
  turn.coefficients_px(1, kX3) = 2.0 / 5;
  turn.coefficients_px(1, kXY2) = 2.0 / 3;
  turn.coefficients_px(1, kX) = 1.0 / 3 + 3.0 / 5;
  turn.coefficients_px = map.unit_px.asDiagonal() * turn.coefficients_px;
  return turn;
}

DetectorDistortion turnedMap(const DetectorDistortion& map, double turn_rad) {
  const DisplacementPolynomial turn = turnOf(map);
  DetectorDistortion turned = map;
  DisplacementPolynomial& shift = turned.shift;
  // Terms of lower degrees come first, whatever the order.
  const Eigen::Index terms = shift.coefficients_px.cols(), added = turn.coefficients_px.cols();
  if (terms < added) {
    shift.order = turn.order;
    shift.coefficients_px.conservativeResize(Eigen::NoChange, added);
    shift.coefficients_px.rightCols(added - terms).setZero();
  }
  shift.coefficients_px.leftCols(added) += turn_rad * turn.coefficients_px;
  return turned;
}

}  // namespace angio::calibration
