// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <limits>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"
#include "field_bytes.hpp"

// What tests do with the fields of any message, by its description.
namespace angio::test {

using wire::ArrayRule;
using wire::Limits;

/// Fills fields with random values that keep their rules.
class RandomFields {
 public:
  explicit RandomFields(Random& random) : random_(random) {}

  template <typename Number>
  void number(const char*, Number& value, const Limits& limits = {}) {
    if constexpr (std::is_floating_point_v<Number>) {
      value = std::isfinite(limits.high) ? random_.uniform(limits.low, limits.high) : random_.normal();
      if (limits.low == 0) value = std::abs(value);
    } else {
      const double end = sizeof value == 1 ? 127 : sizeof value == 4 ? 2e9 : 9e18;
      value = static_cast<Number>(
          static_cast<std::int64_t>(random_.uniform(std::max(limits.low, -end), std::min(limits.high + 1, end))));
    }
  }
  template <typename Values>
  void array(const char*, Values&& values, ArrayRule rule = ArrayRule::kNone) {
    for (Eigen::Index i = 0; i < values.size(); ++i) values(i / values.cols(), i % values.cols()) = random_.normal();
    if constexpr (std::decay_t<Values>::SizeAtCompileTime == 9) {
      if (rule == ArrayRule::kRotation) values = expSE3(random_.twist(1, 1)).linear();
    }
    // A covariance is unsymmetric, so that a swap of rows and columns shows.
    if (rule == ArrayRule::kCovariance) values.diagonal() = values.diagonal().cwiseAbs().eval();
  }
  template <typename T>
  void message(const char*, T& m) {
    wire::Description<T>::fields(*this, m);
  }
  void text(const char*, std::string& text) {
    text = std::string(static_cast<std::size_t>(random_.uniform(0, 80)), 'x') + "\xc3\xa4\n\033[2J";
  }
  template <int Rows>
  void columns(const char*, const char*, wire::Columns<Rows>& values, const wire::WhichRows<Rows>& not_negative) {
    values.resize(Rows, static_cast<Eigen::Index>(random_.uniform(1, 5)));
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      const double value = random_.normal();
      values.data()[i] = static_cast<float>(not_negative[static_cast<std::size_t>(i % Rows)] ? std::abs(value) : value);
    }
  }

 private:
  Random& random_;
};

/// Names of the fields, one for each number of an array, with their bytes.
class FieldValues {
 public:
  using List = std::vector<std::pair<std::string, std::vector<std::uint8_t>>>;

  template <typename T>
  static List of(const T& m) {
    FieldValues values;
    const auto& packed = wire::Description<T>::pack(m);
    wire::Description<T>::fields(values, packed);
    return values.list_;
  }
  template <typename Packed, typename Fields>
  static List of(const Packed& packed, const Fields& fields) {
    FieldValues values;
    fields(values, packed);
    return values.list_;
  }

  template <typename Number>
  void number(const std::string& name, const Number& value, const Limits& = {}) {
    add(name).number("", value);
  }
  template <typename Values>
  void array(const std::string& name, const Values& values, ArrayRule = ArrayRule::kNone) {
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      number(name + "[" + std::to_string(i) + "]", double{values(i / values.cols(), i % values.cols())});
    }
  }
  template <typename T>
  void message(const std::string& name, const T& m) {
    for (const auto& [inner, bytes] : of(m)) list_.emplace_back(name + "." + inner, bytes);
  }
  void text(const std::string& name, const std::string& text) { add(name).text("", text); }
  void bytes(const std::string& size_name, std::int32_t size, const std::string& name,
             const std::vector<std::uint8_t>& bytes) {
    number(size_name, size);
    list_.emplace_back(name, bytes);
  }
  template <int Rows, typename Rule>
  void columns(const std::string& count_name, const std::string& name, const wire::Columns<Rows>& values, const Rule&) {
    number(count_name, static_cast<std::int32_t>(values.cols()));
    for (Eigen::Index i = 0; i < values.size(); ++i) number(name + "[" + std::to_string(i) + "]", values.data()[i]);
  }

 private:
  wire::FieldWriter add(const std::string& name) {
    list_.emplace_back(name, std::vector<std::uint8_t>());
    return wire::FieldWriter(list_.back().second);
  }

  List list_;
};

/// Changes one field: in the way 0 to another value that keeps its rule, in the ways from 1 on to one that breaks it.
class FieldChange {
 public:
  FieldChange(int field, int way) : field_(field), way_(way) {}

  bool made() const { return made_; }                ///< Whether there was such a field, and such a way to change it.
  const std::string& name() const { return name_; }  ///< Of the field, without an index; empty when there was none.

  template <typename Number>
  void number(const char* name, Number& value, const Limits& limits = {}) {
    if (!isIt(name)) return;
    std::vector<double> wrong;
    if (std::is_floating_point_v<Number>) wrong = {kNan, kInf, -kInf};
    if (std::isfinite(limits.low)) wrong.push_back(limits.low - 1);
    if (std::isfinite(limits.high)) wrong.push_back(limits.high + 1);
    if constexpr (std::is_floating_point_v<Number>) {
      change(wrong.size(), [&] { value = value == 1 ? 0.5 : (value + 1) / 2; });
    } else {
      const auto now = static_cast<std::int64_t>(value);
      change(wrong.size(), [&] { value = static_cast<Number>(now == 0 ? 1 : now / 2); });
    }
    if (made_ && way_ > 0) value = static_cast<Number>(wrong[static_cast<std::size_t>(way_ - 1)]);
  }
  template <typename Values>
  void array(const char* name, Values&& values, ArrayRule rule = ArrayRule::kNone) {
    if (rule == ArrayRule::kRotation) {
      if (isIt(name)) rotate(values);
      return;
    }
    for (Eigen::Index r = 0; r < values.rows(); ++r) {
      for (Eigen::Index c = 0; c < values.cols(); ++c) {
        number(name, values(r, c), rule == ArrayRule::kCovariance && r == c ? wire::kNotNegative : Limits());
      }
    }
  }
  template <typename T>
  void message(const char*, T& m) {
    wire::Description<T>::fields(*this, m);
  }
  void text(const char* name, std::string& text) {
    if (!isIt(name)) return;
    change(1, [&] { text += 'y'; });
    if (made_ && way_ == 1) text += '\0';
  }
  void bytes(const char* size_name, std::int32_t& size, const char* name, std::vector<std::uint8_t>& bytes) {
    number(size_name, size);
    if (isIt(name)) change(0, [&] { bytes.front() ^= 1; });
  }
  template <int Rows>
  void columns(const char*, const char* name, wire::Columns<Rows>& values, const wire::WhichRows<Rows>& not_negative) {
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      number(name, values.data()[i], not_negative[static_cast<std::size_t>(i % Rows)] ? wire::kNotNegative : Limits());
    }
  }

 private:
  static constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  static constexpr double kInf = std::numeric_limits<double>::infinity();

  bool isIt(const char* name) {
    if (seen_++ != field_) return false;
    name_ = name;
    return true;
  }

  template <typename ToAnother>
  void change(std::size_t wrong_ways, ToAnother another) {
    made_ = way_ <= static_cast<int>(wrong_ways);
    if (way_ == 0) another();
  }

  template <typename Values>
  void rotate(Values& values) {
    if constexpr (Values::SizeAtCompileTime == 9) {
      change(3, [&] { values = (values * expSE3((Twist() << 0, 0, 0, 0.1, 0.2, 0.3).finished()).linear()).eval(); });
      if (way_ == 1) values(0, 0) = kNan;
      if (way_ == 2) values(1, 2) += 1e-3;
      if (way_ == 3) values = -values.eval();  // Orthonormal, but a mirror.
    }
  }

  int field_, way_, seen_ = 0;
  bool made_ = false;
  std::string name_;
};

/// The fingerprint that lcm-gen gives a type with these fields: of their names, types and sizes, in their order.
class FieldHash {
 public:
  template <typename T>
  static std::int64_t of(const T& m) {
    FieldHash hash;
    const auto& packed = wire::Description<T>::pack(m);
    wire::Description<T>::fields(hash, packed);
    const auto sum = static_cast<std::uint64_t>(hash.hash_) + hash.nested_;
    return static_cast<std::int64_t>((sum << 1) + (sum >> 63));
  }

  template <typename Number>
  void number(const std::string& name, const Number&, const Limits& = {}) {
    add(name);
    add(std::is_floating_point_v<Number> ? "double" : "int" + std::to_string(8 * sizeof(Number)) + "_t");
    update(0);
  }
  template <typename Values>
  void array(const std::string& name, const Values& values, ArrayRule = ArrayRule::kNone) {
    add(name);
    add("double");
    update(1);
    update(0);  // Of constant length.
    add(std::to_string(values.size()));
  }
  template <typename T>
  void message(const std::string& name, const T& m) {
    add(name);
    update(0);
    nested_ += static_cast<std::uint64_t>(of(m));
  }
  void text(const std::string& name, const std::string&) {
    add(name);
    add("string");
    update(0);
  }
  void bytes(const std::string& size_name, std::int32_t size, const std::string& name,
             const std::vector<std::uint8_t>&) {
    number(size_name, size);
    add(name);
    add("byte");
    update(1);
    update(1);  // Of variable length.
    add(size_name);
  }
  template <int Rows, typename Rule>
  void columns(const std::string& count_name, const std::string& name, const wire::Columns<Rows>&, const Rule&) {
    number(count_name, std::int32_t());
    add(name);
    add("float");
    update(2);
    update(1);  // Of variable length, ...
    add(count_name);
    update(0);  // ... and each of constant length.
    add(std::to_string(Rows));
  }

 private:
  void update(int c) {
    const auto bits = static_cast<std::uint64_t>(hash_);
    hash_ = static_cast<std::int64_t>((bits << 8 ^ static_cast<std::uint64_t>(hash_ >> 55)) +
                                      static_cast<std::uint64_t>(c));
  }
  void add(const std::string& text) {
    update(static_cast<int>(text.size()));
    for (const char c : text) update(c);
  }

  std::int64_t hash_ = 0x12345678;
  std::uint64_t nested_ = 0;
};

/// Where the fields lie in the struct that holds them.
class FieldPlaces {
 public:
  struct Place {
    const char* begin;
    const char* end;
    std::size_t alignment;  // 0: not known.
  };

  const std::vector<Place>& places() const { return places_; }

  template <typename Number>
  void number(const char*, const Number& value, const Limits& = {}) {
    add(&value, sizeof value, alignof(Number));
  }
  // A part of a matrix stands for all of its columns: the last row of a pose is none of its fields.
  template <typename Values>
  void array(const char*, const Values& values, ArrayRule = ArrayRule::kNone) {
    constexpr bool kWhole = std::is_same_v<Values, typename Values::PlainObject>;
    add(values.data(), static_cast<std::size_t>(values.outerStride() * values.cols()) * sizeof(double),
        kWhole ? alignof(Values) : 0);
  }
  template <typename T>
  void message(const char*, const T& m) {
    add(&m, sizeof m, alignof(T));
  }
  void text(const char*, const std::string& text) { add(&text, sizeof text, alignof(std::string)); }
  template <int Rows, typename Rule>
  void columns(const char*, const char*, const wire::Columns<Rows>& values, const Rule&) {
    add(&values, sizeof values, alignof(wire::Columns<Rows>));
  }

 private:
  void add(const void* begin, std::size_t size, std::size_t alignment) {
    const auto* first = static_cast<const char*>(begin);
    places_.push_back({first, first + size, alignment});
  }

  std::vector<Place> places_;
};

/// The fields that are restricted by more than being finite, as "name in [0, 5]", "name: covariance".
class FieldLimits {
 public:
  template <typename T>
  static std::vector<std::string> of(const T& m) {
    FieldLimits limits;
    wire::Description<T>::fields(limits, m);
    return limits.lines_;
  }

  template <typename Number>
  void number(const std::string& name, const Number&, const Limits& limits = {}) {
    if (std::isfinite(limits.low))
      lines_.push_back(name + " in [" + formatValue(limits.low) + ", " + formatValue(limits.high) + "]");
  }
  template <typename Values>
  void array(const std::string& name, const Values&, ArrayRule rule = ArrayRule::kNone) {
    if (rule != ArrayRule::kNone) {
      lines_.push_back(name + (rule == ArrayRule::kRotation ? ": rotation" : ": covariance"));
    }
  }
  template <typename T>
  void message(const std::string& name, const T& m) {
    for (const std::string& line : of(m)) lines_.push_back(name + "." + line);
  }
  void text(const std::string&, const std::string&) {}
  template <int Rows>
  void columns(const std::string&, const std::string& name, const wire::Columns<Rows>&,
               const wire::WhichRows<Rows>& not_negative) {
    for (std::size_t i = 0; i < Rows; ++i) {
      if (not_negative[i]) lines_.push_back(name + "[][" + std::to_string(i) + "] in [0, inf]");
    }
  }

 private:
  std::vector<std::string> lines_;
};

}  // namespace angio::test
