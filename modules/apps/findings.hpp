// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/base/formatted.hpp"

namespace angio::apps {

using Json = nlohmann::ordered_json;

inline const std::string kUnknown = "not said";

/// With a question mark for each letter that cannot be printed: a file may hold any.
inline std::string withoutControls(std::string words) {
  std::replace_if(
      words.begin(), words.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return words;
}

/// A number for people: four digits behind the point at most, and the unit after a blank.
inline std::string inWords(double number, const std::string& unit) {
  std::string digits = formatted("%.4f", number == 0 ? 0.0 : number);
  digits.erase(digits.find_last_not_of('0') + 1);
  if (digits.back() == '.') digits.pop_back();
  return (digits == "-0" ? "0" : digits) + (unit.empty() ? "" : " " + unit);
}

/// "31.3 LAO": DICOM's signs in the words of the trade.
inline std::string beamInWords(double primary_deg, double secondary_deg) {
  return inWords(std::abs(primary_deg), primary_deg < 0 ? "deg RAO, " : "deg LAO, ") +
         inWords(std::abs(secondary_deg), secondary_deg < 0 ? "deg CAU" : "deg CRA");
}

/// One thing a person wants to know of a file: for people a label and words, for programs a key with its unit and a
/// value.
struct Finding {
  std::string label, words, key;
  Json value;
};

/// All of them, in their order.
struct Findings : std::vector<Finding> {
  void add(const std::string& label, const std::string& words, const std::string& key, const Json& value) {
    push_back({label, words, key, value});
  }

  void text(const char* label, const char* key, const std::string& value) {
    add(label, value.empty() ? kUnknown : value, key, value.empty() ? Json(nullptr) : Json(value));
  }

  void count(const char* label, const char* key, std::int64_t value, const char* more = "") {
    add(label, std::to_string(value) + more, key, value);
  }

  void number(const char* label, const char* key, const std::optional<double>& value, const char* unit) {
    add(label, value ? inWords(*value, unit) : kUnknown, key, value ? Json(*value) : Json(nullptr));
  }

  void length(const char* label, const char* key, const std::optional<double>& length_m) {
    number(label, key, length_m ? std::optional(1e3 * *length_m) : std::nullopt, "mm");
  }

  void size(int width_px, int height_px) {
    add("size", std::to_string(width_px) + " x " + std::to_string(height_px) + " px", "image_size_px",
        {width_px, height_px});
  }
};

}  // namespace angio::apps
