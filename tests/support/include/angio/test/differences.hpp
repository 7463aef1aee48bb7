// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

#include "angio/test/namespace.hpp"

namespace angio::test {

/// Jacobian of f (vector to vector) at x by central differences of step h: off by h^2 f'''/6 and eps |f| / h.
template <typename Function>
Eigen::MatrixXd centralDifferences(const Function& f, const Eigen::VectorXd& x, double h) {
  Eigen::MatrixXd J;
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    Eigen::VectorXd above = x, below = x;
    above[k] += h;
    below[k] -= h;
    const Eigen::VectorXd column = (f(above) - f(below)) / (2 * h);
    if (k == 0) J.resize(column.size(), x.size());
    J.col(k) = column;
  }
  return J;
}

}  // namespace angio::test
