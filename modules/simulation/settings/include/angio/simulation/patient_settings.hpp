// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/simulation/bolus_settings.hpp"
#include "angio/simulation/device_settings.hpp"
#include "angio/simulation/fluoroscopy_settings.hpp"
#include "angio/simulation/motion_settings.hpp"
#include "angio/simulation/truth_settings.hpp"

namespace angio::simulation_settings {

/// All that a simulated X-ray run can be told: how it looks, what is injected, what moves, and what is pushed in.
struct SimulatedPatientSettings {
  FluoroscopySettings fluoroscopy;
  BolusSettings bolus;
  MotionSettings motion;
  DeviceSettings device;
  TruthSettings truth;

  SimulatedPatientSettings() = default;

  /// The X-ray alone, by conversion: a tree at rest that is full of contrast agent.
  SimulatedPatientSettings(const FluoroscopySettings& look) : fluoroscopy(look) {}

  /// The X-ray's own keys stand at the top, the others in sections.
  void visit(SettingsVisitor& v) {
    fluoroscopy.visit(v);
    v.section("bolus", [this](SettingsVisitor& s) { bolus.visit(s); });
    v.section("motion", [this](SettingsVisitor& s) { motion.visit(s); });
    v.section("device", [this](SettingsVisitor& s) { device.visit(s); });
    v.section("truth", [this](SettingsVisitor& s) { truth.visit(s); });
  }
};

}  // namespace angio::simulation_settings
