// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <tuple>

#include "angio/apps/namespace.hpp"
#include "angio/base/variant_tuple.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/perception/patient_tracker.hpp"
#include "angio/registration/starts.hpp"
#include "angio/results/case_run.hpp"
#include "extractor_options.hpp"

namespace angio::apps {

/// The settings file of the registration programs: one section per method of registration and of extraction, whatever
/// methods there are.
class ProgramSettings {
 public:
  StartSettings starts;
  ExtractorSections extractors;
  PatientTrackerSettings tracker = trackerOfCases();  ///< Of sequences.

  void visit(SettingsVisitor& v) {
    std::apply([&](auto&... method) { (visitSection(v, method.kName, method), ...); }, methods_);
    visitSection(v, "starts", starts);
    extractors.visit(v);
    visitSection(v, "tracker", tracker);
  }

  /// The section of one method.
  template <typename Method>
  Method& of() {
    return std::get<Method>(methods_);
  }

  /// The settings of one method, or of a preset, which the file leaves as it is; `deformation` counts whatever the file
  /// says. Throws InputError where a rigid method is to be nonrigid.
  RegistrationSettings of(const std::string& name, std::optional<Deformation> deformation) const {
    RegistrationSettings chosen = registrationSettingsNamed(name);
    std::visit(
        [&](auto& s) {
          if (!isPreset(name)) s = std::get<std::decay_t<decltype(s)>>(methods_);
        },
        chosen);
    if (deformation && !setDeformation(chosen, *deformation)) {
      throw InputError("--nonrigid", "--method", name, "must be a method that lets the tree deform");
    }
    return chosen;
  }

 private:
  template <typename Settings>
  static void visitSection(SettingsVisitor& v, const char* key, Settings& settings) {
    v.section(key, [&](SettingsVisitor& inner) { settings.visit(inner); });
  }

  OneOfEach<RegistrationSettings> methods_;
};

/// The method's effective settings under its name, for the result file.
inline nlohmann::ordered_json methodAsJson(const RegistrationSettings& method) {
  return {{methodName(method), std::visit([](const auto& s) { return settingsAsJson(s); }, method)}};
}

/// The extractor that an option names, or else the file's choice.
inline ExtractorSettings chosenExtractor(const ProgramSettings& settings, const std::string& option) {
  return option.empty() ? settings.extractors.chosen() : settings.extractors.named(option);
}

/// An extractor's effective settings under its name.
inline nlohmann::ordered_json extractorAsJson(const ExtractorSettings& extractor) {
  return std::visit([](const auto& s) { return nlohmann::ordered_json{{s.kName, settingsAsJson(s)}}; }, extractor);
}

}  // namespace angio::apps
