// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "angio/results/statistics.hpp"

namespace angio::results {

// What is reported of an experiment's records is a list of columns.

/// One column of an experiment's report.
template <typename Record>
struct Column {
  std::string row;                           ///< Path of the value in a run's row ("predicted/held"); empty: not there.
  std::string summary;                       ///< Path of its figures in the summary; empty: none.
  std::string figures;                       ///< Their names, as figuresOf() takes them.
  std::function<Json(const Record&)> value;  ///< Null where a run has none.
};

/// One run as other programs read it.
template <typename Record>
Json rowOf(const Record& record, const std::vector<Column<Record>>& columns) {
  Json row;
  for (const auto& column : columns) {
    if (column.row.empty()) continue;
    Json value = column.value(record);
    if (!value.is_null()) row[Json::json_pointer("/" + column.row)] = std::move(value);
  }
  return row;
}

template <typename Record>
Json rowsOf(const std::vector<Record>& records, const std::vector<Column<Record>>& columns) {
  Json rows = Json::array();
  for (const Record& record : records) rows.push_back(rowOf(record, columns));
  return rows;
}

/// Adds the figures of all runs to `summary`.
template <typename Record>
void summarise(const std::vector<Record>& records, const std::vector<Column<Record>>& columns, Json& summary) {
  for (const auto& column : columns) {
    if (column.summary.empty()) continue;
    Json values = Json::array();
    for (const Record& record : records) values.push_back(column.value(record));
    summary[Json::json_pointer("/" + column.summary)] = figuresOf(values, column.figures);
  }
}

}  // namespace angio::results
