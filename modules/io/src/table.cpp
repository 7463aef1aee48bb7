// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/table.hpp"

#include <algorithm>

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::io {
namespace {

std::string listed(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ",") + name;
  return list;
}

bool contains(const std::vector<std::string>& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::vector<std::string> readHeader(const TextLines& lines, const TableColumns& columns) {
  std::vector<std::string_view> parts;
  splitAt(',', lines.text(), parts);
  std::string rule = "must be the columns " + listed(columns.required) + " separated by commas";
  if (!columns.optional.empty()) rule += "; optional: " + listed(columns.optional);
  std::vector<std::string> header;
  for (const std::string_view part : parts) {
    const std::string name(trimmed(part));
    if (!contains(columns.required, name) && !contains(columns.optional, name)) {
      throw InputError(lines.place(), "header", name, rule);
    }
    if (contains(header, name)) throw InputError(lines.place(), "header", name, "must not name a column twice");
    header.push_back(name);
  }
  for (const std::string& name : columns.required) {
    if (!contains(header, name)) throw InputError(lines.place(), "header", "", name + " is missing; " + rule);
  }
  return header;
}

}  // namespace

std::string TableRow::place() const { return atLine(path_, line_); }

bool TableRow::has(std::string_view column) const { return contains(header_, column); }

std::string_view TableRow::field(std::string_view column) const {
  return fields_[static_cast<std::size_t>(std::find(header_.begin(), header_.end(), column) - header_.begin())];
}

double TableRow::number(const std::string& column) const { return parseNumber(place(), column, field(column)); }

std::optional<double> TableRow::numberOrBlank(const std::string& column) const {
  if (field(column).empty()) return std::nullopt;
  return number(column);
}

int TableRow::integer(const std::string& column) const { return parseInteger(place(), column, field(column)); }

void readTable(const std::string& path, const TableColumns& columns,
               const std::function<void(const TableRow&)>& take_row) {
  const std::string content = readWholeFile(path, kMaxTextFile);
  TextLines lines(path, content);
  if (!lines.next()) throw InputError(atLine(path, 1), "header", "", "the file is empty");
  const std::vector<std::string> header = readHeader(lines, columns);
  if (lines.count() < 2) throw InputError(atLine(path, 2), "rows", "0", "must have at least one row after the header");
  if (lines.count() - 1 > kMaxPoints) {
    throw InputError(path, "rows", std::to_string(lines.count() - 1), "must not exceed " + std::to_string(kMaxPoints));
  }
  std::vector<std::string_view> fields;
  while (lines.next()) {
    splitAt(',', lines.text(), fields);
    if (fields.size() != header.size()) {
      throw InputError(lines.place(), "columns", std::to_string(fields.size()),
                       "must be " + std::to_string(header.size()) + " as in the header, separated by commas");
    }
    for (std::string_view& field : fields) field = trimmed(field);
    take_row(TableRow(path, lines.number(), header, fields));
  }
}

}  // namespace angio::io
