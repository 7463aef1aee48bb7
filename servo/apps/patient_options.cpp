// SPDX-License-Identifier: GPL-2.0-or-later
#include "patient_options.hpp"

#include <memory>

#include "angio/base/errors.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/measured_motion_file.hpp"

namespace angio::apps {

void PatientOptions::addTo(cli::Command& app, cli::Option* needs) {
  cli::Option* const all[] = {
      app.addOption("--filled", filled,
                    "Share of the simulated vessels that contrast agent fills, downstream of drawn sites")
          ->check(between(0.02, 1))
          ->defaultText("1"),
      app.addOption("--missing-branches", missing,
                    "Share of the simulated vessels, branches at random, that no contrast agent reaches")
          ->check(between(0, 0.98))
          ->defaultText("0"),
      app.addOption("--deformation-mm", deformation_mm,
                    "How far the simulated vessels are deformed against the tree at all times (rms)")
          ->check(between(0, 30))
          ->defaultText("0"),
      app.addOption("--deformation-field", deformation_field,
                    "A measured motion (.csv) that deforms them; otherwise smooth waves do")};
  for (auto* option : all) {
    if (needs) option->needs(needs);
  }
}

void PatientOptions::applyTo(SimulatedPatientSettings& patient) const {
  patient.filling.filled = filled.value_or(patient.filling.filled);
  patient.filling.missing = missing.value_or(patient.filling.missing);
  TreeDeformationSettings& deformation = patient.motion.deformation;
  deformation.rms_mm = deformation_mm.value_or(deformation.rms_mm);
  if (deformation_field.empty()) return;
  if (deformation.rms_mm <= 0) {
    throw InputError("--deformation-field", "--deformation-mm", "0", "must be above 0: the size of the deformation");
  }
  deformation.measured = std::make_shared<const MeasuredMotion>(readMeasuredMotion(deformation_field));
}

}  // namespace angio::apps
