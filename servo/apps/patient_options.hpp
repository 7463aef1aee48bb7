// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/cli/command_line_fwd.hpp"
#include "angio/simulation/patient_settings.hpp"

namespace angio::apps {

/// What a command line says of a simulated patient; it comes before the settings file's.
struct PatientOptions {
  std::optional<double> filled, missing, deformation_mm;
  std::string deformation_field;

  /// @param needs  An option without which these are refused; null: none.
  void addTo(cli::Command& app, cli::Option* needs = nullptr);

  /// Throws InputError for a field without a size, or one that cannot be read.
  void applyTo(SimulatedPatientSettings& patient) const;
};

}  // namespace angio::apps
