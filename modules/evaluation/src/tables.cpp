// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/tables.hpp"

#include "angio/base/formatted.hpp"
#include "angio/evaluation/statistics.hpp"

namespace angio::evaluation {

using Json = nlohmann::ordered_json;

std::string markdownTable(const std::vector<std::vector<std::string>>& rows) {
  std::string text;
  for (const auto& row : rows) {
    text += "|";
    for (const std::string& cell : row) text += (cell.empty() ? "" : " " + cell) + " |";
    text += "\n";
    if (&row != &rows.front()) continue;
    text += "|";
    for (std::size_t i = 0; i < row.size(); ++i) text += " --- |";
    text += "\n";
  }
  return text;
}

std::string figureOf(const Json& summary, const std::string& path, const char* format, double factor) {
  const Json::json_pointer pointer("/" + path);
  if (!summary.contains(pointer) || !summary[pointer].is_number()) return "-";
  return formatted(format, factor * summary[pointer].get<double>());
}

std::string figureTable(const std::string& of, const Json& summary_by_name, const std::vector<FigureColumn>& columns) {
  std::vector<std::vector<std::string>> rows{{of}};
  for (const FigureColumn& column : columns) rows[0].push_back(column.title);
  for (const auto& [name, summary] : summary_by_name.items()) {
    auto& row = rows.emplace_back(1, name);
    for (const FigureColumn& c : columns) row.push_back(figureOf(summary, c.path, c.format, c.factor));
  }
  return markdownTable(rows);
}

Json spreadOf(const std::vector<double>& values) {
  return {{"mean", mean(values)},
          {"median", percentile(values, 0.5)},
          {"p75", percentile(values, 0.75)},
          {"p95", percentile(values, 0.95)},
          {"max", percentile(values, 1)}};
}

}  // namespace angio::evaluation
