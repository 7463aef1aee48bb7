// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/messaging/namespace.hpp"
#include "angio/types/loop_input.hpp"

namespace angio::messaging::wire {

/// How a message stands on the wire, what holds for it, and how it is shown. Codec, rules, text and tests of a message
/// follow from its description; each message has one, in messages/.
///
///   using Wire          What lcm-gen makes of the .lcm file: type name and fingerprint.
///   fields(v, m)        Names each field to a visitor, by its name and in the order of the .lcm file:
///                         v.number(name, value, limits)  Integer, double or enum.
///                         v.array(name, values, rule)    Vector or matrix of doubles, row by row.
///                         v.message(name, m)             A struct with a description of its own.
///                         v.text(name, text)             Stands last.
///                         v.bytes(name of the size, size, name, bytes)   Stands last.
///                         v.columns(name of their count, name, matrix, not_negative)   Floats, column by column; which
///                                                      rows must not be negative. Stands last.
///   line(m)             The message in one line for people.
template <typename T>
struct Description;

/// Longest message [bytes]: LCM counts in int, and its headers need room.
constexpr std::int64_t kMaxMessage = 2'000'000'000;

/// What a number may be, both bounds included; a number that is not finite is refused always.
struct Limits {
  double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
};
constexpr Limits kNotNegative{0}, kProbability{0, 1};
/// Of the times of frames and states, and of what is said about a frame [us]: 142 years either way, so that no
/// difference of two of them overflows. Those of commands and requests are not bounded: a stop is obeyed whatever its
/// time says.
constexpr Limits kUtime{-0x1p52, 0x1p52};
constexpr Limits oneOf(int count) { return {0, count - 1.0}; }

/// What an array of numbers must be, beside finite; a covariance: with a diagonal that is not negative.
enum class ArrayRule { kNone, kCovariance, kRotation };

/// As many columns of floats as there are.
template <int Rows>
using Columns = Eigen::Matrix<float, Rows, Eigen::Dynamic>;
template <int Rows>
using WhichRows = std::array<bool, static_cast<std::size_t>(Rows)>;

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

  template <int Rows>
  void columns(const char* count_name, const char* name, const Columns<Rows>& values,
               const WhichRows<Rows>& not_negative) {
    if (values.cols() > kMaxMessage / (Rows * static_cast<Eigen::Index>(sizeof(float))))
      fail(count_name, "is too large");
    for (Eigen::Index i = 0; i < values.size() && !broken_; ++i) {
      check(name, i, values.data()[i], not_negative[static_cast<std::size_t>(i % Rows)] ? kNotNegative : Limits());
    }
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

/// Part of the description of a message whose members are its fields.
template <typename T, typename LcmType>
struct PlainDescription {
  using Wire = LcmType;

  /// What fields() visits, and the ways there and back; unpack() may throw InputError.
  using Packed = T;
  static const T& pack(const T& m) { return m; }
  static T unpack(T&& m) { return std::move(m); }

  /// The first rule of the wire that a message breaks, in one line; nothing when it may go on the wire. Sender and
  /// receiver ask the same, so that whatever is decoded could have been encoded.
  static std::optional<std::string> broken(const T& m) {
    FieldRules rules;
    Description<T>::fields(rules, m);
    return rules.broken();
  }
};

// What the lines of several messages have in common.

inline long long count(std::int64_t number) { return static_cast<long long>(number); }

/// The beginning of a text from the bus, without what would move a terminal's cursor.
inline std::string harmless(const std::string& text, std::size_t max_shown = 60) {
  std::string shown = text.substr(0, max_shown);
  for (char& c : shown) {
    if (c < 0x20 || c >= 0x7f) c = '?';
  }
  return text.size() > max_shown ? shown + "..." : shown;
}

inline std::string jointsText(const CArmJoints& q, const char* per_s = "") {
  return formatted("%+.2f %+.2f deg%s, table %+.1f %+.1f %+.1f mm%s", radToDeg(q[0]), radToDeg(q[1]), per_s, 1e3 * q[2],
                   1e3 * q[3], 1e3 * q[4], per_s);
}

inline std::string verdictText(std::int64_t frame_sequence, ServoVerdict verdict) {
  constexpr const char* kVerdicts[kServoVerdictCount] = {"", ", taken back", ", refused"};
  return formatted("frame %lld%s with ", count(frame_sequence), kVerdicts[static_cast<int>(verdict)]);
}

inline std::string answerText(std::int64_t frame_sequence, std::int64_t valid_for_us) {
  return formatted("frame %lld, for %.0f ms: ", count(frame_sequence), 1e-3 * static_cast<double>(valid_for_us));
}

}  // namespace angio::messaging::wire
