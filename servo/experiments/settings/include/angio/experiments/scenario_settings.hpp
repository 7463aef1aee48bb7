// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/scenario_settings/namespace.hpp"
#include "angio/simulation/lab_settings.hpp"

namespace angio::scenario_settings {

/// What a closed-loop simulation is about: where the C-arm starts, how wrong its calibration is, and how long it takes.
struct ScenarioSettings {
  double start_primary_deg = 0;  ///< C-arm angles at the start.
  double start_secondary_deg = 0;
  double patient_turn_deg = 4;  ///< How far the patient lies from straight: known to calibration.
  double patient_shift_mm = 15;
  double calibration_error_deg = 3;  ///< How wrong T_dsa_cb is, about an axis across the beam: all tilts the view.
  double calibration_error_mm = 10;
  double duration_s = 10;
  LabSettings lab;
  int seed = 1;  ///< Of patient, calibration error, anatomy and noise.

  void visit(SettingsVisitor& v) {
    v.number("start_primary_deg", start_primary_deg, -110, 110);
    v.number("start_secondary_deg", start_secondary_deg, -55, 55);
    v.number("patient_turn_deg", patient_turn_deg, 0, 45);
    v.number("patient_shift_mm", patient_shift_mm, 0, 200);
    v.number("calibration_error_deg", calibration_error_deg, 0, 45);
    v.number("calibration_error_mm", calibration_error_mm, 0, 200);
    v.number("duration_s", duration_s, 0.1, 3600);
    v.section("lab", [this](SettingsVisitor& inner) { lab.visit(inner); });
    v.integer("seed", seed, 0, 2147483647);
  }
};

}  // namespace angio::scenario_settings
