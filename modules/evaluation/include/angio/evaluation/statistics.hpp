// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/evaluation/namespace.hpp"

namespace angio::evaluation {

/// Mean; 0 for no values.
double mean(const std::vector<double>& values);

/// The value below which `share` (0 to 1) of the values lie, linear between neighbours; 0 for no values. A value that
/// is not a number counts as larger than all others: what failed must not disappear.
double percentile(std::vector<double> values, double share);

}  // namespace angio::evaluation
