// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cmath>

namespace angio::geometry {

/// Correlation (1 + x + x^2 / 3) exp(-x) of a twice differentiable random process at two places that are `x` apart, not
/// negative, in units of its length: Matern 5/2, whose usual length is sqrt(5) of these.
///
/// Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), equation 4.17.
inline double maternCorrelation(double x) { return (1 + x + x * x / 3) * std::exp(-x); }

}  // namespace angio::geometry
