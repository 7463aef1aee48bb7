// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <tuple>

#include "angio/imaging/extractor.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/registration/starts.hpp"

namespace angio {

/// The settings file of the registration programs: one section per method, whatever methods there are.
class ProgramSettings {
 public:
  StartSettings starts;
  OtsuSettings otsu;

  void visit(SettingsVisitor& v) {
    std::apply([&](auto&... method) { (visitSection(v, method.kName, method), ...); }, methods_);
    visitSection(v, "starts", starts);
    visitSection(v, OtsuSettings::kName, otsu);
  }

  /// The settings of one method; `nonrigid` asks for a deformation whatever the file says.
  RegistrationSettings of(const std::string& name, std::optional<Deformation> deformation) const {
    RegistrationSettings chosen = registrationSettingsNamed(name);
    std::visit([&](auto& s) {
      s = std::get<std::decay_t<decltype(s)>>(methods_);
      if (deformation) s.deformation = *deformation;
    }, chosen);
    return chosen;
  }

 private:
  template <typename Settings>
  static void visitSection(SettingsVisitor& v, const char* key, Settings& settings) {
    v.section(key, [&](SettingsVisitor& inner) { settings.visit(inner); });
  }

  template <typename Variant>
  struct TupleOf;
  template <typename... Settings>
  struct TupleOf<std::variant<Settings...>> {
    using type = std::tuple<Settings...>;
  };
  TupleOf<RegistrationSettings>::type methods_;
};

/// The method's effective settings under its name, for the result file.
inline nlohmann::ordered_json methodAsJson(const RegistrationSettings& method) {
  return {{methodName(method), std::visit([](const auto& s) { return settingsAsJson(s); }, method)}};
}

}  // namespace angio
