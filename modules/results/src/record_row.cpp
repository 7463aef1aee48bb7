// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/results/record_row.hpp"

#include <limits>

#include "angio/base/errors.hpp"

namespace angio::results {
namespace {

// Lists and maps are not written out: a message is a line.
std::string rowText(const Json& value) {
  if (value.is_structured()) return value.is_array() ? "(list of " + std::to_string(value.size()) + ")" : "(map)";
  return value.dump(-1, ' ', true, Json::error_handler_t::replace).substr(0, 40);
}

template <typename Integer>
void readWhole(const Json& row, const RowPlace& place, Integer& value) {
  using Limits = std::numeric_limits<Integer>;
  if (!row.is_number_integer()) place.refuse(row, "must be a whole number");
  const bool fits = row.is_number_unsigned() ? row.get<std::uint64_t>() <= static_cast<std::uint64_t>(Limits::max())
                                             : row.get<std::int64_t>() >= static_cast<std::int64_t>(Limits::lowest());
  if (!fits) place.refuse(row, "must be a whole number that fits");
  value = row.get<Integer>();
}

// Of a rotation's columns from being one: rows are exact, and what a solver leaves is a rotation to 1e-9.
constexpr double kRotationDefect = 1e-6;

}  // namespace

void RowPlace::refuse(const Json& value, const std::string& rule) const {
  throw InputError(file, field.empty() ? "row" : field, rowText(value), rule);
}

const Json& memberOf(const Json& object, const std::string& key, const RowPlace& place) {
  if (!object.is_object()) place.refuse(object, "must be a map");
  const auto found = object.find(key);
  if (found == object.end()) throw InputError(place.file, place.at(key).field, "", "is missing");
  return *found;
}

Json toRow(bool value) { return value; }
Json toRow(int value) { return value; }
Json toRow(long value) { return value; }
Json toRow(double value) { return value; }
Json toRow(const std::string& value) { return value; }
Json toRow(const Json& value) { return value; }

Json toRow(const Eigen::Isometry3d& pose) { return toRow(Eigen::Matrix<double, 3, 4>(pose.matrix().topRows<3>())); }

void fromRow(const Json& row, const RowPlace& place, bool& value) {
  if (!row.is_boolean()) place.refuse(row, "must be true or false");
  value = row.get<bool>();
}

void fromRow(const Json& row, const RowPlace& place, int& value) { readWhole(row, place, value); }
void fromRow(const Json& row, const RowPlace& place, long& value) { readWhole(row, place, value); }

void fromRow(const Json& row, const RowPlace& place, double& value) {
  if (!row.is_number()) place.refuse(row, "must be a number");
  value = row.get<double>();
}

void fromRow(const Json& row, const RowPlace& place, std::string& value) {
  if (!row.is_string()) place.refuse(row, "must be a text");
  value = row.get<std::string>();
}

void fromRow(const Json& row, const RowPlace&, Json& value) { value = row; }

void fromRow(const Json& row, const RowPlace& place, Eigen::Isometry3d& pose) {
  Eigen::Matrix<double, 3, 4> matrix;
  fromRow(row, place, matrix);
  const Eigen::Matrix3d R = matrix.leftCols<3>();
  const double defect = (R.transpose() * R - Eigen::Matrix3d::Identity()).norm();
  if (defect > kRotationDefect || R.determinant() < 0) place.refuse(row, "must be a rotation and a translation");
  pose.setIdentity();
  pose.matrix().topRows<3>() = matrix;
}

}  // namespace angio::results
