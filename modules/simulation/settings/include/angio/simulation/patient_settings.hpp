// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/simulation/fluoroscopy_settings.hpp"
#include "angio/simulation/motion_settings.hpp"
#include "angio/simulation_settings/namespace.hpp"

namespace angio::simulation_settings {

/// Which injection a bolus has from the start: the one of its settings, or none until one is demanded.
enum class BolusTrigger { kSettings, kDemand };

/// Injections of contrast agent at the tree's root, and the blood that carries it.
///
/// Blood moves at `speed_m_per_s` where the radius is 2 mm, and in proportion to the radius elsewhere, as it does in a
/// tree of Murray's law. The defaults are plausible for a liver's arteriogram by hand injection; they are nobody's
/// measurement.
struct BolusSettings {
  bool enabled = false;
  BolusTrigger trigger = BolusTrigger::kSettings;
  double start_s = 0.3;
  double injection_s = 2;
  double speed_m_per_s = 0.3;
  double wash_in_s = 0.25;
  double wash_out_s = 0.8;
  double dispersion = 0.15;  ///< Fronts get longer by this part of the time since the root.

  void visit(SettingsVisitor& v) {
    v.flag("enabled", enabled, "Contrast agent comes and goes; otherwise the tree is full of it at all times");
    v.choice("trigger", trigger, {"settings", "demand"}, "What begins an injection: these settings, or a demand");
    v.number("start_s", start_s, 0, 3600, "With trigger settings: when the injection begins, after the first frame");
    v.number("injection_s", injection_s, 0.05, 600, "With trigger settings: how long the injection lasts");
    v.number("speed_m_per_s", speed_m_per_s, 0.01, 5, "Speed of blood where the radius is 2 mm");
    v.number("wash_in_s", wash_in_s, 0.01, 30, "Time from a tenth to nine tenths of the full density, at the root");
    v.number("wash_out_s", wash_out_s, 0.01, 60, "Time constant of the contrast agent's end");
    v.fixed("dispersion", dispersion, 0, 2);
  }
};

/// Contrast agent in a part of the vessels for the whole run; branches are filled or empty as a whole.
struct FillingSettings {
  double filled = 1;
  double missing = 0;

  void visit(SettingsVisitor& v) {
    v.number("filled", filled, 0.02, 1,
             "Share of the tree's length that is filled, downstream of drawn injection sites");
    v.number("missing", missing, 0, 0.98,
             "Share of the tree's length, branches at random, that no contrast agent reaches");
  }
};

enum class DeviceKind { kNone, kCatheter, kGuidewire };

/// A device that is pushed into the tree. Unless set, it has the size and opacity of what it is: a catheter of 5 French
/// (1.67 mm, its wall filled with barium), or a guidewire of 0.014 inch of steel with 20 mm of platinum coil at its tip
/// (NIST XCOM at 60 keV: steel 0.95, platinum 8 per mm).
struct DeviceSettings {
  DeviceKind kind = DeviceKind::kNone;
  double diameter_factor = 1;  ///< Of the usual diameter.
  double opacity_factor = 1;   ///< Of the usual attenuation.
  int tip_branch = 0;
  double inserted_mm = 60;
  double speed_mm_per_s = 0;

  void visit(SettingsVisitor& v) {
    v.choice("kind", kind, {"none", "catheter", "guidewire"}, "Device in the vessels");
    v.integer("tip_branch", tip_branch, 0, 100000,
              "Which end of the tree the device goes for: 0 the farthest from its root, 1 the next, ...");
    v.number("inserted_mm", inserted_mm, 1, 3000,
             "Length inside the tree at the first frame; it ends where the tree does");
    v.number("speed_mm_per_s", speed_mm_per_s, -200, 200, "Speed of pushing (or, if negative, pulling)");
    v.fixed("diameter_factor", diameter_factor, 0.1, 10);
    v.fixed("opacity_factor", opacity_factor, 0, 10);
  }
};

/// What counts as visible.
struct TruthSettings {
  /// A vessel is seen when what it takes from the beam, over the quantum noise of a square as wide as it is, exceeds
  /// this: Rose's criterion, 3 to 5 (Rose, J Opt Soc Am 38, 1948).
  double min_contrast_to_noise = 4;
  double spacing_px = 1;
  double min_px = 8;  ///< Shorter visible pieces are left out.

  void visit(SettingsVisitor& v) {
    v.number("spacing_px", spacing_px, 0.2, 50, "Distance between points of the true centrelines");
    v.fixed("min_contrast_to_noise", min_contrast_to_noise, 0, 1000);
    v.fixed("min_px", min_px, 0, 1000);
  }
};

/// All that a simulated X-ray run can be told: how it looks, what is injected, what moves, and what is pushed in.
struct SimulatedPatientSettings {
  FluoroscopySettings fluoroscopy;
  BolusSettings bolus;
  FillingSettings filling;
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
    v.section("filling", [this](SettingsVisitor& s) { filling.visit(s); });
    v.section("motion", [this](SettingsVisitor& s) { motion.visit(s); });
    v.section("device", [this](SettingsVisitor& s) { device.visit(s); });
    v.section("truth", [this](SettingsVisitor& s) { truth.visit(s); });
  }
};

}  // namespace angio::simulation_settings
