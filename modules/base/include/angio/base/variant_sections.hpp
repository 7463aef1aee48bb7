// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/base/joined.hpp"
#include "angio/base/settings.hpp"
#include "angio/base/variant_tuple.hpp"

namespace angio::base {

/// All settings that a variant of settings can hold, a section each by its kName, and which one is chosen: for settings
/// files.
template <typename Variant>
class VariantSections {
 public:
  /// @param key      What the choice is called in a settings file: "task".
  /// @param meaning  What it chooses, in a few words.
  VariantSections(const char* key, const Variant& chosen, const char* meaning)
      : key_(key), meaning_(meaning), index_(static_cast<int>(chosen.index())) {
    std::visit([this](const auto& s) { std::get<std::decay_t<decltype(s)>>(settings_) = s; }, chosen);
  }

  static std::vector<std::string> names() { return namesOf(std::make_index_sequence<std::variant_size_v<Variant>>()); }

  void visit(SettingsVisitor& v) {
    v.choiceIndex(key_, index_, names(), meaning_);
    std::apply([&](auto&... each) { (visitSection(v, each), ...); }, settings_);
  }

  /// Throws InputError that lists the names there are.
  void choose(const std::string& name) {
    const std::vector<std::string> known = names();
    const auto found = std::find(known.begin(), known.end(), name);
    if (found == known.end()) throw InputError("", key_, name, "must be one of " + joined(known));
    index_ = static_cast<int>(found - known.begin());
  }

  Variant chosen() const { return chosenOf(std::make_index_sequence<std::variant_size_v<Variant>>()); }

  /// The settings of the alternative with this name, chosen or not. Throws as choose() does.
  Variant named(const std::string& name) const {
    VariantSections sections = *this;
    sections.choose(name);
    return sections.chosen();
  }

  /// One alternative's settings, chosen or not.
  template <typename Settings>
  Settings& of() {
    return std::get<Settings>(settings_);
  }
  template <typename Settings>
  const Settings& of() const {
    return std::get<Settings>(settings_);
  }

 private:
  template <std::size_t... I>
  static std::vector<std::string> namesOf(std::index_sequence<I...>) {
    return {std::variant_alternative_t<I, Variant>::kName...};
  }

  template <std::size_t... I>
  Variant chosenOf(std::index_sequence<I...>) const {
    Variant result;
    ((static_cast<int>(I) == index_ ? void(result = std::get<I>(settings_)) : void()), ...);
    return result;
  }

  template <typename Settings>
  void visitSection(SettingsVisitor& v, Settings& settings) const {
    const std::string meaning = std::string("With ") + key_ + " " + Settings::kName;
    v.section(
        Settings::kName, [&](SettingsVisitor& inner) { settings.visit(inner); }, meaning.c_str());
  }

  const char* key_;
  const char* meaning_;
  int index_;
  OneOfEach<Variant> settings_;
};

}  // namespace angio::base
