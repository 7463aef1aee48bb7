// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/results/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <regex>
#include <sstream>

#include "angio/base/formatted.hpp"

namespace angio::results {
namespace {

void addNumbers(const Json& value, std::vector<double>& numbers) {
  if (value.is_array()) {
    for (const Json& one : value) addNumbers(one, numbers);
  } else if (!value.is_null()) {
    numbers.push_back(value.is_boolean() ? value.get<bool>() : value.get<double>());
  }
}

bool isWhole(const Json& value) {
  return value.is_array() ? std::all_of(value.begin(), value.end(), isWhole) : !value.is_number_float();
}

Json figureOf(const Json& values, const std::vector<double>& numbers, const std::string& name) {
  const double sum = std::accumulate(numbers.begin(), numbers.end(), 0.0), count = static_cast<double>(numbers.size());
  if (name == "sum") return isWhole(values) ? Json(std::llround(sum)) : Json(sum);
  if (name == "count") return numbers.size();
  if (name == "mean") return mean(numbers);
  if (name == "percent") return numbers.empty() ? 0.0 : 100 * sum / count;
  if (name == "rms") return std::sqrt(std::inner_product(numbers.begin(), numbers.end(), numbers.begin(), 0.0) / count);
  return percentile(numbers, name == "max" ? 1 : name == "median" ? 0.5 : std::stod(name.substr(1)) / 100);
}

std::string printed(const Json& value, const std::string& format, double factor) {
  const char conversion = format[std::min(format.find_first_of("dsgf", format.find('%')), format.size() - 1)];
  if (conversion == 's') return value.is_string() ? formatted(format.c_str(), value.get<std::string>().c_str()) : "-";
  if (!value.is_number()) return "-";
  if (conversion == 'd') return formatted(format.c_str(), value.get<int>());
  return formatted(format.c_str(), factor * value.get<double>());
}

}  // namespace

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

Json figuresOf(const Json& values, const std::string& names) {
  std::vector<double> numbers;
  addNumbers(values, numbers);
  if (names.find(' ') == std::string::npos) return figureOf(values, numbers, names);
  Json figures;
  std::istringstream all(names);
  for (std::string name; all >> name;) figures[name] = figureOf(values, numbers, name);
  return figures;
}

std::string filled(const std::string& text, const Json& values) {
  static const std::regex kPlace(R"(\{(?:([0-9.e]+)\*)?([^:{}]+):([^{}]*)\})");
  std::string result;
  auto rest = text.begin();
  for (std::sregex_iterator place(text.begin(), text.end(), kPlace), end; place != end; ++place) {
    const Json::json_pointer path("/" + place->str(2));
    const double factor = (*place)[1].matched ? std::stod(place->str(1)) : 1;
    result.append(rest, (*place)[0].first);
    result += values.contains(path) ? printed(values[path], place->str(3), factor) : "-";
    rest = (*place)[0].second;
  }
  return result.append(rest, text.end());
}

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

std::string figureTable(const Json& summaries, const std::vector<TableColumn>& columns) {
  std::vector<std::vector<std::string>> rows(1);
  for (const TableColumn& column : columns) rows[0].push_back(column.title);
  for (const auto& [name, summary] : summaries.items()) {
    auto& row = rows.emplace_back();
    for (const TableColumn& c : columns) row.push_back(*c.cell ? filled(c.cell, summary) : name);
  }
  return markdownTable(rows);
}

}  // namespace angio::results
