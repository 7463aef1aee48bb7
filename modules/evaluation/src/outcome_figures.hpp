// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <vector>

#include "angio/evaluation/case_run.hpp"
#include "angio/evaluation/tables.hpp"

namespace angio::evaluation {

template <typename Figure>
std::vector<double> figuresOf(const std::vector<CaseOutcome>& outcomes, const Figure& figure) {
  std::vector<double> values;
  for (const CaseOutcome& outcome : outcomes) values.push_back(figure(outcome));
  return values;
}

template <typename Figure>
nlohmann::ordered_json spreadOf(const std::vector<CaseOutcome>& outcomes, const Figure& figure) {
  return spreadOf(figuresOf(outcomes, figure));
}

template <typename Rule>
double percentOf(const std::vector<CaseOutcome>& outcomes, const Rule& holds) {
  const auto count = std::count_if(outcomes.begin(), outcomes.end(), holds);
  return outcomes.empty() ? 0.0 : 100.0 * static_cast<double>(count) / static_cast<double>(outcomes.size());
}

}  // namespace angio::evaluation
