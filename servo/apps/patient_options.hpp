// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/measured_motion_file.hpp"
#include "angio/simulation/patient_settings.hpp"

namespace angio::apps {

/// What a command line says of a simulated patient; it comes before the settings file's.
struct PatientOptions {
  std::optional<double> filled, missing, deformation_mm;
  std::string deformation_field;

  /// @param needs  An option without which these are refused; null: none.
  void addTo(CLI::App& app, CLI::Option* needs = nullptr) {
    CLI::Option* const all[] = {
        app.add_option("--filled", filled,
                       "Share of the simulated vessels that contrast agent fills, downstream of drawn sites")
            ->check(between(0.02, 1))
            ->default_str("1"),
        app.add_option("--missing-branches", missing,
                       "Share of the simulated vessels, branches at random, that no contrast agent reaches")
            ->check(between(0, 0.98))
            ->default_str("0"),
        app.add_option("--deformation-mm", deformation_mm,
                       "How far the simulated vessels are deformed against the tree at all times (rms)")
            ->check(between(0, 30))
            ->default_str("0"),
        app.add_option("--deformation-field", deformation_field,
                       "A measured motion (.csv) that deforms them; otherwise smooth waves do")};
    for (auto* option : all) {
      if (needs) option->needs(needs);
    }
  }

  /// Throws InputError for a field without a size, or one that cannot be read.
  void applyTo(SimulatedPatientSettings& patient) const {
    patient.filling.filled = filled.value_or(patient.filling.filled);
    patient.filling.missing = missing.value_or(patient.filling.missing);
    TreeDeformationSettings& bend = patient.motion.deformation;
    bend.rms_mm = deformation_mm.value_or(bend.rms_mm);
    if (deformation_field.empty()) return;
    if (bend.rms_mm <= 0) {
      throw InputError("--deformation-field", "--deformation-mm", "0", "must be above 0: the size of the deformation");
    }
    bend.measured = std::make_shared<const MeasuredMotion>(readMeasuredMotion(deformation_field));
  }
};

}  // namespace angio::apps
