// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <tuple>

#include "angio/base/variant_tuple.hpp"
#include "angio/imaging/extractor.hpp"

namespace angio::imaging {

/// All extractors' settings, a section each, and which one is chosen: for settings files.
class ExtractorSections {
 public:
  explicit ExtractorSections(const ExtractorSettings& chosen = RidgeSettings{})
      : index_(static_cast<int>(chosen.index())) {
    std::visit([this](const auto& s) { std::get<std::decay_t<decltype(s)>>(settings_) = s; }, chosen);
  }

  /// The key `extractor` with a method's name, and a section by each method's name.
  void visit(SettingsVisitor& v) {
    v.choiceIndex("extractor", index_, extractorNames());
    std::apply([&](auto&... method) { (visitSection(v, method), ...); }, settings_);
  }

  ExtractorSettings chosen() const { return named(extractorNames()[static_cast<std::size_t>(index_)]); }

  /// The settings of an extractor, chosen or not. Throws InputError that lists the names there are.
  ExtractorSettings named(const std::string& name) const {
    ExtractorSettings result = extractorSettingsNamed(name);
    std::visit([&](auto& s) { s = std::get<std::decay_t<decltype(s)>>(settings_); }, result);
    return result;
  }

 private:
  template <typename Settings>
  static void visitSection(SettingsVisitor& v, Settings& settings) {
    v.section(Settings::kName, [&](SettingsVisitor& inner) { settings.visit(inner); });
  }

  OneOfEach<ExtractorSettings> settings_;
  int index_;
};

}  // namespace angio::imaging
