// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace angio::evaluation {

double mean(const std::vector<double>& values) {
  return values.empty() ? 0.0 : std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end(),
            [](double a, double b) { return !std::isnan(a) && (std::isnan(b) || a < b); });
  const double at = std::clamp(share, 0.0, 1.0) * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  const double weight = at - static_cast<double>(below);
  if (weight == 0) return values[below];  // A neighbour that is not a number has no part in it.
  return (1 - weight) * values[below] + weight * values[above];
}

}  // namespace angio::evaluation
