// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// One row of a CSV file whose columns have names.
class TableRow {
 public:
  TableRow(std::string path, int line, const std::vector<std::string>& header,
           const std::vector<std::string_view>& fields)
      : path_(std::move(path)), line_(line), header_(header), fields_(fields) {}

  int line() const { return line_; }
  std::string place() const;
  bool has(std::string_view column) const;

  /// Each throws InputError "path:line: column = text: rule"; the column must be there.
  double number(const std::string& column) const;
  std::optional<double> numberOrBlank(const std::string& column) const;
  int integer(const std::string& column) const;
  std::string_view text(std::string_view column) const;  ///< As it stands, without blanks.

 private:
  std::string path_;
  int line_;
  const std::vector<std::string>& header_;
  const std::vector<std::string_view>& fields_;
};

/// The columns a table may have, in any order.
struct TableColumns {
  std::vector<std::string> required;
  std::vector<std::string> optional;
};

/// Reads a strict CSV file with a header and at least one row: commas, no quotes; CRLF and a byte order mark pass. Rows
/// are given one by one, so that a broken file costs no memory. Throws InputError that names file, line, field, value
/// and rule.
void readTable(const std::string& path, const TableColumns& columns,
               const std::function<void(const TableRow&)>& take_row);

}  // namespace angio::io
