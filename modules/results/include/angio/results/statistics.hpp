// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/results/namespace.hpp"

namespace angio::results {

using Json = nlohmann::ordered_json;

/// Mean; 0 for no values.
double mean(const std::vector<double>& values);

/// The value below which `share` (0 to 1) of the values lie, linear between neighbours; 0 for no values. A value that
/// is not a number counts as larger than all others: what failed must not disappear.
double percentile(std::vector<double> values, double share);

/// Null for a value that is not there. The result is a parameter because Json is whole only where this is called.
template <typename Value, typename Result = Json>
Result orNull(const std::optional<Value>& value) {
  return value ? Result(*value) : Result(nullptr);
}

/// Figures of values by their names, separated by blanks: sum, count, mean, rms, percent (of values that are true),
/// max, median, and percentiles such as p50 or p99. One name gives a number, several an object. Values are numbers,
/// flags, or lists of them; null is none.
Json figuresOf(const Json& values, const std::string& names);

/// The figures of a spread as evaluations give it.
constexpr const char* kSpread = "mean median p75 p95 max";

/// `text` with each {path:format} replaced by that value of `values`, as printf prints it: "{mtre_mm/median:%.3f mm}",
/// "{100*covered:%.1f %%}", "{runs:%d}", "{fault:%s}". "-" for a value that is not there, or is no number.
std::string filled(const std::string& text, const Json& values);

/// A table in Markdown; the first row is the head.
std::string markdownTable(const std::vector<std::vector<std::string>>& rows);

/// A column of a table of summaries: what filled() makes of its cell; the summary's own name where that is empty.
struct TableColumn {
  const char *title, *cell;
};

/// One row for each summary of a list or an object, as Markdown.
std::string figureTable(const Json& summaries, const std::vector<TableColumn>& columns);

}  // namespace angio::results
