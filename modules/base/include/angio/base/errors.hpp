// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cmath>
#include <stdexcept>
#include <string>

#include "angio/base/namespace.hpp"

namespace angio::base {

/// Wrong input by the user: a file, a setting, an argument. Thrown before the first frame, never in the loop.
///
/// what() is one line: "place: field = value: rule", for example
/// "camera.yaml:2: fx_px = -5: must be positive". Parts that are empty are left out.
class InputError : public std::runtime_error {
 public:
  /// @param place  File and line, or the name of the object ("tree.csv:17", "camera").
  /// @param field  Name of the field with its unit ("fx_px"), or empty.
  /// @param value  What was found there, or empty.
  /// @param rule   What was expected, in words.
  InputError(const std::string& place, const std::string& field, const std::string& value, const std::string& rule);

  /// The same error seen from further out: its place is put in front ("cases.yaml:12: " ...).
  InputError within(const std::string& outer_place) const;

 private:
  explicit InputError(const std::string& line) : std::runtime_error(line) {}
};

/// A number as a person would type it, for messages: "-5", "0.25", "nan".
std::string formatValue(double value);

/// Throws InputError unless `value` is finite and greater than zero. Returns the value.
double requirePositive(const std::string& place, const std::string& field, double value);

/// Throws InputError unless `value` is finite. Returns the value.
double requireFinite(const std::string& place, const std::string& field, double value);

/// Throws InputError unless `low <= value <= high`. Returns the value.
double requireBetween(const std::string& place, const std::string& field, double value, double low, double high);

}  // namespace angio::base
