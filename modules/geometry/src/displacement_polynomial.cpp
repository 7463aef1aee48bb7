// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/displacement_polynomial.hpp"

#include <array>

#include "angio/base/errors.hpp"

namespace angio::geometry {
namespace {

using LegendreValues = std::array<double, DisplacementPolynomial::kMaxOrder + 1>;

// Legendre polynomials of one variable with their first and second derivatives, by the recurrences
// n P_n = (2n - 1) x P_(n-1) - (n - 1) P_(n-2) and P'_n = P'_(n-2) + (2n - 1) P_(n-1).
struct LegendreRow {
  LegendreValues value{}, first{}, second{};

  LegendreRow(int order, double x) {
    value[0] = 1;
    if (order == 0) return;
    value[1] = x;
    first[1] = 1;
    for (int n = 2; n <= order; ++n) {
      value[n] = ((2 * n - 1) * x * value[n - 1] - (n - 1) * value[n - 2]) / n;
      first[n] = first[n - 2] + (2 * n - 1) * value[n - 1];
      second[n] = second[n - 2] + (2 * n - 1) * first[n - 1];
    }
  }
};

template <typename Take>
void forEachTerm(int order, const Take& take) {
  Eigen::Index term = 0;
  for (int degree = 0; degree <= order; ++degree) {
    for (int a = degree; a >= 0; --a) take(term++, a, degree - a);
  }
}

// The polynomial at a point of the unit circle, with the derivatives that are asked for: of x and of y, by xx, xy, yy.
struct PolynomialValue {
  Eigen::Vector2d value = Eigen::Vector2d::Zero();
  Eigen::Matrix2d first = Eigen::Matrix2d::Zero();
  Eigen::Matrix<double, 2, 3> second = Eigen::Matrix<double, 2, 3>::Zero();
};

PolynomialValue polynomialAt(const DisplacementPolynomial& polynomial, const Eigen::Vector2d& p, int derivatives) {
  const LegendreRow x(polynomial.order, p.x()), y(polynomial.order, p.y());
  PolynomialValue sum;
  forEachTerm(polynomial.order, [&](Eigen::Index term, int a, int b) {
    const Eigen::Vector2d c = polynomial.coefficients_px.col(term);
    sum.value += x.value[a] * y.value[b] * c;
    if (derivatives < 1) return;
    sum.first.col(0) += x.first[a] * y.value[b] * c;
    sum.first.col(1) += x.value[a] * y.first[b] * c;
    if (derivatives < 2) return;
    sum.second.col(0) += x.second[a] * y.value[b] * c;
    sum.second.col(1) += x.first[a] * y.first[b] * c;
    sum.second.col(2) += x.value[a] * y.second[b] * c;
  });
  return sum;
}

}  // namespace

Eigen::VectorXd DisplacementPolynomial::terms(int order, const Eigen::Vector2d& p) {
  const LegendreRow x(order, p.x()), y(order, p.y());
  Eigen::VectorXd row(termCount(order));
  forEachTerm(order, [&](Eigen::Index term, int a, int b) { row[term] = x.value[a] * y.value[b]; });
  return row;
}

Eigen::Vector2d DisplacementPolynomial::at(const Eigen::Vector2d& p, Eigen::Matrix2d* J) const {
  if (coefficients_px.cols() == 0) {
    if (J) J->setZero();
    return Eigen::Vector2d::Zero();
  }
  const double r = p.norm();
  if (r <= 1) {
    const PolynomialValue inside = polynomialAt(*this, p, J ? 1 : 0);
    if (J) *J = inside.first;
    return inside.value;
  }
  const Eigen::Vector2d u = p / r;
  const PolynomialValue rim = polynomialAt(*this, u, J ? 2 : 1);
  const Eigen::Vector2d along = rim.first * u;
  if (J) {
    const Eigen::Matrix2d du = (Eigen::Matrix2d::Identity() - u * u.transpose()) / r;
    Eigen::Matrix2d turned;
    turned.col(0) = rim.second.col(0) * u.x() + rim.second.col(1) * u.y();
    turned.col(1) = rim.second.col(1) * u.x() + rim.second.col(2) * u.y();
    *J = (rim.first + (r - 1) * (rim.first + turned)) * du + along * u.transpose();
  }
  return rim.value + (r - 1) * along;
}

void DisplacementPolynomial::check(const std::string& place) const {
  requireBetween(place, "order", order, 1, kMaxOrder);
  if (coefficients_px.cols() != termCount(order)) {
    throw InputError(
        place, "shift_x_px, shift_y_px", std::to_string(coefficients_px.cols()),
        "must be " + std::to_string(termCount(order)) + " numbers each for order " + std::to_string(order));
  }
  for (Eigen::Index k = 0; k < coefficients_px.cols(); ++k) {
    requireFinite(place, "shift_x_px", coefficients_px(0, k));
    requireFinite(place, "shift_y_px", coefficients_px(1, k));
  }
}

}  // namespace angio::geometry
