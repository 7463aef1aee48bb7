// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "angio/evaluation/namespace.hpp"

namespace angio::evaluation {

/// A table in Markdown; the first row is the head.
std::string markdownTable(const std::vector<std::vector<std::string>>& rows);

/// A figure of a summary by its path ("mtre_mm/median"), times `factor`; "-" where there is none.
std::string figureOf(const nlohmann::ordered_json& summary, const std::string& path, const char* format,
                     double factor = 1);

/// A column of a table of summaries.
struct FigureColumn {
  const char *title, *path, *format;
  double factor = 1;
};

/// One row for each summary, which it is named by, as Markdown. `of` is what the names are.
std::string figureTable(const std::string& of, const nlohmann::ordered_json& summary_by_name,
                        const std::vector<FigureColumn>& columns);

/// Mean, median, 75th and 95th percentile and maximum of values.
nlohmann::ordered_json spreadOf(const std::vector<double>& values);

}  // namespace angio::evaluation
