// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/scenario_settings/namespace.hpp"
#include "angio/simulation/lab_settings.hpp"

namespace angio::scenario_settings {

/// What a closed-loop simulation is about: where the C-arm starts, how wrong its calibration is, and how long it takes.
struct ScenarioSettings {
  double start_primary_deg = 0;
  double start_secondary_deg = 0;
  double patient_turn_deg = 4;
  double patient_shift_mm = 15;
  double calibration_error_deg = 3;
  double calibration_error_mm = 10;
  double duration_s = 10;
  LabSettings lab;
  int seed = 1;

  void visit(SettingsVisitor& v) {
    v.number("start_primary_deg", start_primary_deg, -110, 110, "Primary angle of the C-arm at the start");
    v.number("start_secondary_deg", start_secondary_deg, -55, 55, "Secondary angle of the C-arm at the start");
    v.number("patient_turn_deg", patient_turn_deg, 0, 45,
             "How far the patient is turned from lying straight: known to calibration");
    v.number("patient_shift_mm", patient_shift_mm, 0, 200,
             "How far the patient is shifted from lying straight: known to calibration");
    v.number("calibration_error_deg", calibration_error_deg, 0, 45,
             "Error of T_dsa_cb, a turn about an axis across the beam: all of it tilts the view");
    v.number("calibration_error_mm", calibration_error_mm, 0, 200, "Error of T_dsa_cb, a shift");
    v.number("duration_s", duration_s, 0.1, 3600, "How long the simulation takes");
    v.section("lab", [this](SettingsVisitor& inner) { lab.visit(inner); });
    v.integer("seed", seed, 0, 2147483647, "Seed of patient, calibration error, anatomy and noise");
  }
};

}  // namespace angio::scenario_settings
