// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "angio/base/namespace.hpp"

namespace angio::base {

/// Walks over the fields of a settings struct: reading, writing and checking are visitors, so that each field is named
/// once.
///
/// A settings struct offers `void visit(SettingsVisitor& v)`, with one line per field:
///     v.integer("iterations", iterations, 1, 1000, "Most iterations of the search");
/// Keys carry units (`spacing_mm`); the values behind them are in the unit the key names. `meaning` says in a few words
/// what the field is, for who reads a settings file: it is the field's documentation, and stands nowhere else.
class SettingsVisitor {
 public:
  virtual ~SettingsVisitor() = default;
  virtual void number(const char* key, double& value, double low, double high, const char* meaning) = 0;
  virtual void integer(const char* key, int& value, int low, int high, const char* meaning) = 0;
  virtual void flag(const char* key, bool& value, const char* meaning) = 0;
  /// A list of exactly `count` numbers, each within [low, high].
  virtual void numbers(const char* key, double* values, int count, double low, double high, const char* meaning) = 0;
  virtual void choiceIndex(const char* key, int& index, const std::vector<std::string>& names, const char* meaning) = 0;
  virtual void section(const char* key, const std::function<void(SettingsVisitor&)>& visit_fields,
                       const char* meaning = "") = 0;

  /// A number that only code sets: no key of settings files, but checked as the others are.
  virtual void fixed(const char* /*name*/, double /*value*/, double /*low*/, double /*high*/) {}

  /// An enum whose values count from 0, by its names.
  template <typename Enum>
  void choice(const char* key, Enum& value, const std::vector<std::string>& names, const char* meaning) {
    int index = static_cast<int>(value);
    choiceIndex(key, index, names, meaning);
    value = static_cast<Enum>(index);
  }
};

/// Throws InputError that names `place`, key, value and rule when a field is out of its range or not finite.
void checkSettings(const std::string& place, const std::function<void(SettingsVisitor&)>& visit_fields);

/// What visits the fields of `settings`, which must outlive it.
template <typename Settings>
std::function<void(SettingsVisitor&)> fieldsOf(Settings& settings) {
  return [&settings](SettingsVisitor& v) { settings.visit(v); };
}

/// The same for a struct with `visit`.
template <typename Settings>
void checkSettings(const std::string& place, Settings settings) {
  checkSettings(place, fieldsOf(settings));
}

/// What `make` returns for the alternative that a variant of settings holds, once that has been checked: by its
/// `kName`, and as checkSettings() does.
template <typename Variant, typename Make>
auto madeOf(const Variant& settings, const Make& make) {
  const auto checked = [&](const auto& chosen) {
    checkSettings(chosen.kName, chosen);
    return make(chosen);
  };
  return std::visit(checked, settings);
}

}  // namespace angio::base
