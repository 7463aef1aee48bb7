// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>

#include "angio/base/errors.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/messaging/namespace.hpp"

namespace angio::messaging::wire {

template <typename T>
struct Description;

/// Longest message [bytes]: LCM counts in int, and its headers need room.
constexpr std::int64_t kMaxMessage = 2'000'000'000;

/// What a number may be, both bounds included; a number that is not finite is refused always.
struct Limits {
  double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
};
constexpr Limits kNotNegative{0}, kProbability{0, 1};
constexpr Limits oneOf(int count) { return {0, count - 1.0}; }

/// What an array of numbers must be, beside finite; a covariance: with a diagonal that is not negative.
enum class ArrayRule { kNone, kCovariance, kRotation };

/// Visits a message's fields and keeps the first rule that one of them breaks.
class FieldRules {
 public:
  const std::optional<std::string>& broken() const { return broken_; }

  template <typename Number>
  void number(const char* name, const Number& value, const Limits& limits = {}) {
    check(name, "", static_cast<double>(value), limits);
  }

  template <typename Values>
  void array(const char* name, const Values& values, ArrayRule rule = ArrayRule::kNone) {
    if (rule == ArrayRule::kRotation) {
      if (!isRotation(values)) fail(name, "must be a rotation matrix");
      return;
    }
    for (Eigen::Index i = 0; i < values.size(); ++i) check(name, i, values(i / values.cols(), i % values.cols()), {});
    if (rule != ArrayRule::kCovariance) return;
    for (Eigen::Index i = 0; i < values.rows(); ++i) check(name, "'s diagonal", values(i, i), kNotNegative);
  }

  template <typename T>
  void message(const char*, const T& m) {
    Description<T>::fields(*this, m);
  }

  void text(const char* name, const std::string& text) {
    if (text.find('\0') != std::string::npos) fail(name, "must not contain a NUL");
    if (static_cast<std::int64_t>(text.size()) > kMaxMessage) fail(name, "is too long");
  }

 private:
  template <typename Values>
  static bool isRotation(const Values& values) {
    // Far looser than rounding (1e-15) and far tighter than any error that matters (1e-6 rad is 1 um at 1 m).
    constexpr double kMaxDefect = 1e-6;
    if constexpr (Values::SizeAtCompileTime == 9) return rotationDefect(values) <= kMaxDefect;
    return false;
  }

  // Names a field only when it breaks its rule: messages are checked at the rate of the encoders.
  template <typename Part>
  void check(const char* name, const Part& part, double value, const Limits& limits) {
    const bool bounded = std::isfinite(limits.high);
    if ((bounded || std::isfinite(value)) && value >= limits.low && value <= limits.high) return;
    std::string field = name;
    if constexpr (std::is_integral_v<Part>) {
      field += "[" + std::to_string(part) + "]";
    } else {
      field += part;
    }
    fail(field + " = " + formatValue(value),
         bounded                ? "must be in [" + formatValue(limits.low) + ", " + formatValue(limits.high) + "]"
         : std::isfinite(value) ? "must not be negative"
                                : "must be finite");
  }

  void fail(const std::string& field, const std::string& rule) {
    if (!broken_) broken_ = field + ": " + rule;
  }

  std::optional<std::string> broken_;
};

}  // namespace angio::messaging::wire
