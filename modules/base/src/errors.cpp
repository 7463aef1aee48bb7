// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/errors.hpp"

#include <cstdio>

namespace angio::base {
namespace {

// Input can hold anything, and the message must stay one printable line.
std::string printable(const std::string& text, std::size_t longest = 120) {
  std::string line;
  for (const char c : text.substr(0, longest)) {
    const auto byte = static_cast<unsigned char>(c);
    line += byte < 0x20 || byte == 0x7f ? '?' : c;
  }
  return text.size() > longest ? line + "..." : line;
}

std::string joined(const std::string& place, const std::string& field, const std::string& value,
                   const std::string& rule) {
  std::string line = printable(place, 4096);
  if (!field.empty()) line += (line.empty() ? "" : ": ") + printable(field);
  if (!value.empty()) line += (field.empty() ? ": '" : " = ") + printable(value) + (field.empty() ? "'" : "");
  return line + (line.empty() ? "" : ": ") + printable(rule, 4096);
}

}  // namespace

InputError::InputError(const std::string& place, const std::string& field, const std::string& value,
                       const std::string& rule)
    : std::runtime_error(joined(place, field, value, rule)) {}

InputError InputError::within(const std::string& outer_place) const {
  return InputError(printable(outer_place, 4096) + ": " + what());
}

std::string formatValue(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

double requirePositive(const std::string& place, const std::string& field, double value) {
  if (!(std::isfinite(value) && value > 0))
    throw InputError(place, field, formatValue(value), "must be a positive number");
  return value;
}

double requireFinite(const std::string& place, const std::string& field, double value) {
  if (!std::isfinite(value)) throw InputError(place, field, formatValue(value), "must be a finite number");
  return value;
}

double requireBetween(const std::string& place, const std::string& field, double value, double low, double high) {
  if (!(value >= low && value <= high)) {
    throw InputError(place, field, formatValue(value),
                     "must lie between " + formatValue(low) + " and " + formatValue(high));
  }
  return value;
}

}  // namespace angio::base
