// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
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
  bool enabled = false;  ///< Otherwise the tree is full of contrast agent at all times.
  BolusTrigger trigger = BolusTrigger::kSettings;
  double start_s = 0.3;        ///< Trigger kSettings: when the injection begins, after the first frame.
  double injection_s = 2;      ///< Trigger kSettings: how long the injection lasts.
  double speed_m_per_s = 0.3;  ///< Of blood where the radius is 2 mm.
  double wash_in_s = 0.25;     ///< From a tenth to nine tenths of the full density, at the root.
  double wash_out_s = 0.8;     ///< Time constant of the end.
  double dispersion = 0.15;    ///< Fronts get longer by this part of the time since the root.

  void visit(SettingsVisitor& v) {
    v.flag("enabled", enabled);
    v.choice("trigger", trigger, {"settings", "demand"});
    v.number("start_s", start_s, 0, 3600);
    v.number("injection_s", injection_s, 0.05, 600);
    v.number("speed_m_per_s", speed_m_per_s, 0.01, 5);
    v.number("wash_in_s", wash_in_s, 0.01, 30);
    v.number("wash_out_s", wash_out_s, 0.01, 60);
  }
};

}  // namespace angio::simulation_settings
