// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "angio/results/statistics.hpp"

namespace angio::results {

// A record of an experiment as a row that another program can go on with: toRow() writes it and fromRow() reads it, to
// the last bit. A record says its fields once, for both ways:
//
//   template <typename Fields>
//   void visitRow(Fields& f, RecordOf<Fields, Journey>& journey) {
//     f("seed", journey.seed);
//     f("errors_m", journey.errors_m);
//   }
//
// A choice is an enum that says how many values it has: constexpr int choicesOf(Status) { return 4; }

/// Where a row stands, for what is wrong with it: "shard-2.json:14", and the path of a field in it, "result/times".
struct RowPlace {
  std::string file, field;

  RowPlace at(const std::string& key) const { return {file, field.empty() ? key : field + "/" + key}; }

  /// Throws InputError.
  [[noreturn]] void refuse(const Json& value, const std::string& rule) const;
};

/// The member of an object. Throws InputError when it is not there.
const Json& memberOf(const Json& object, const std::string& key, const RowPlace& place);

class RowWriter;
class RowReader;
template <typename Fields, typename Record>
using RecordOf = std::conditional_t<std::is_same_v<Fields, RowWriter>, const Record, Record>;

Json toRow(bool value);
Json toRow(int value);
Json toRow(long value);
Json toRow(double value);
Json toRow(const std::string& value);
Json toRow(const Json& value);
Json toRow(const Eigen::Isometry3d& pose);
void fromRow(const Json& row, const RowPlace& place, bool& value);
void fromRow(const Json& row, const RowPlace& place, int& value);
void fromRow(const Json& row, const RowPlace& place, long& value);
void fromRow(const Json& row, const RowPlace& place, double& value);
void fromRow(const Json& row, const RowPlace& place, std::string& value);
void fromRow(const Json& row, const RowPlace& place, Json& value);
void fromRow(const Json& row, const RowPlace& place, Eigen::Isometry3d& pose);

template <typename Value>
Json toRow(const std::optional<Value>& value);
template <typename Value>
void fromRow(const Json& row, const RowPlace& place, std::optional<Value>& value);
template <typename Value>
Json toRow(const std::vector<Value>& values);
template <typename Value>
void fromRow(const Json& row, const RowPlace& place, std::vector<Value>& values);
template <int kRows, int kColumns>
Json toRow(const Eigen::Matrix<double, kRows, kColumns>& matrix);
template <int kRows, int kColumns>
void fromRow(const Json& row, const RowPlace& place, Eigen::Matrix<double, kRows, kColumns>& matrix);
template <typename Record, typename = std::enable_if_t<std::is_class_v<Record> || std::is_enum_v<Record>>>
Json toRow(const Record& record);
template <typename Record, typename = std::enable_if_t<std::is_class_v<Record> || std::is_enum_v<Record>>>
void fromRow(const Json& row, const RowPlace& place, Record& record);

/// Fields of a record by their keys, to a row.
class RowWriter {
 public:
  template <typename Value>
  void operator()(const char* key, const Value& value) {
    row[key] = toRow(value);
  }

  Json row = Json::object();
};

/// Fields of a record by their keys, from a row. Throws InputError where one is missing or of another type.
class RowReader {
 public:
  RowReader(const Json& row, const RowPlace& place) : row_(row), place_(place) {}

  template <typename Value>
  void operator()(const char* key, Value& value) {
    fromRow(memberOf(row_, key, place_), place_.at(key), value);
  }

 private:
  const Json& row_;
  const RowPlace& place_;
};

template <typename Value>
Json toRow(const std::optional<Value>& value) {
  return value ? toRow(*value) : Json(nullptr);
}

template <typename Value>
void fromRow(const Json& row, const RowPlace& place, std::optional<Value>& value) {
  value.reset();
  if (!row.is_null()) fromRow(row, place, value.emplace());
}

template <typename Value>
Json toRow(const std::vector<Value>& values) {
  Json row = Json::array();
  for (const Value& value : values) row.push_back(toRow(value));
  return row;
}

template <typename Value>
void fromRow(const Json& row, const RowPlace& place, std::vector<Value>& values) {
  if (!row.is_array()) place.refuse(row, "must be a list");
  values.clear();
  values.resize(row.size());
  for (std::size_t i = 0; i < row.size(); ++i) fromRow(row[i], place.at(std::to_string(i)), values[i]);
}

/// Column by column; a matrix whose columns are not known before has as many as the list is long.
template <int kRows, int kColumns>
Json toRow(const Eigen::Matrix<double, kRows, kColumns>& matrix) {
  Json row = Json::array();
  for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
    for (Eigen::Index i = 0; i < kRows; ++i) row.push_back(matrix(i, j));
  }
  return row;
}

template <int kRows, int kColumns>
void fromRow(const Json& row, const RowPlace& place, Eigen::Matrix<double, kRows, kColumns>& matrix) {
  static_assert(kRows != Eigen::Dynamic);
  std::vector<double> numbers;
  fromRow(row, place, numbers);
  const auto count = static_cast<Eigen::Index>(numbers.size());
  if (kColumns == Eigen::Dynamic ? count % kRows != 0 : count != kRows * kColumns) {
    place.refuse(row, "must be the numbers of a matrix of " + std::to_string(kRows) + " rows");
  }
  matrix = Eigen::Map<const Eigen::Matrix<double, kRows, kColumns>>(numbers.data(), kRows, count / kRows);
}

template <typename Record, typename>
Json toRow(const Record& record) {
  if constexpr (std::is_enum_v<Record>) {
    return static_cast<int>(record);
  } else {
    RowWriter fields;
    visitRow(fields, record);
    return std::move(fields.row);
  }
}

template <typename Record, typename>
void fromRow(const Json& row, const RowPlace& place, Record& record) {
  if constexpr (std::is_enum_v<Record>) {
    int number = 0;
    fromRow(row, place, number);
    if (number < 0 || number >= choicesOf(Record{})) place.refuse(row, "must be one of its choices, by number");
    record = static_cast<Record>(number);
  } else {
    RowReader fields(row, place);
    visitRow(fields, record);
  }
}

}  // namespace angio::results
