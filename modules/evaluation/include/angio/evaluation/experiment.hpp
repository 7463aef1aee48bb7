// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "angio/base/interruption.hpp"
#include "angio/evaluation/statistics.hpp"

namespace angio::evaluation {

// An experiment is a number of runs that do not depend on each other, each of which leaves one record, and a list of
// columns that says what is reported of the records.

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

/// Called with how many runs are done, by one at a time.
using Progress = std::function<void(int done)>;

/// Runs `one(k)` for k = 0 .. count - 1, up to `threads` at a time, and comes back when all are done. The first failure
/// comes out here as InputError or std::runtime_error in which `nameOf(k)` names the run, and no more are begun. After
/// SIGINT or SIGTERM no more are begun either, and a run that throws Interrupted is given up. Returns which runs are
/// finished. Throws Interrupted when none is.
std::vector<bool> forEachRun(int count, int threads, const std::function<std::string(int k)>& nameOf,
                             const std::function<void(int k)>& one, const Progress& done = {});

/// The same with the record that each finished run leaves, in their order.
template <typename One>
auto recordsOf(int count, int threads, const std::function<std::string(int k)>& nameOf, const One& one,
               const Progress& done = {}) {
  std::vector<decltype(one(0))> records(static_cast<std::size_t>(count));
  const std::vector<bool> finished = forEachRun(
      count, threads, nameOf, [&](int k) { records[static_cast<std::size_t>(k)] = one(k); }, done);
  std::size_t kept = 0;
  for (std::size_t k = 0; k < records.size(); ++k) {
    if (finished[k]) std::swap(records[kept++], records[k]);
  }
  records.resize(kept);
  return records;
}

/// Does one part of an experiment of several, and returns whether to go on. After SIGINT or SIGTERM it returns false,
/// and a part of which nothing is finished is left out; `has_results` of parts before it, or Interrupted goes on its
/// way.
template <typename Part>
bool finishPart(bool has_results, const Part& part) {
  try {
    part();
  } catch (const Interrupted&) {
    if (!has_results) throw;
  }
  return !interrupted();
}

/// Processor, cores, compiler, versions: what a time depends on.
Json machineAsJson();

}  // namespace angio::evaluation
