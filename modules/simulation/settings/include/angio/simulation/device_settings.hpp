// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/simulation_settings/namespace.hpp"

namespace angio::simulation_settings {

enum class DeviceKind { kNone, kCatheter, kGuidewire };

/// A device that is pushed into the tree. Unless set, it has the size and opacity of what it is: a catheter of 5 French
/// (1.67 mm, its wall filled with barium), or a guidewire of 0.014 inch of steel with 20 mm of platinum coil at its tip
/// (NIST XCOM at 60 keV: steel 0.95, platinum 8 per mm).
struct DeviceSettings {
  DeviceKind kind = DeviceKind::kNone;
  double diameter_factor = 1;  ///< Of the usual diameter.
  double opacity_factor = 1;   ///< Of the usual attenuation.
  int tip_branch = 0;          ///< Which end of the tree it goes for: 0 the farthest from its root, 1 the next...
  double inserted_mm = 60;     ///< Length inside the tree at the first frame; it ends where the tree does.
  double speed_mm_per_s = 0;   ///< Of pushing (or, if negative, pulling).

  void visit(SettingsVisitor& v) {
    v.choice("kind", kind, {"none", "catheter", "guidewire"});
    v.integer("tip_branch", tip_branch, 0, 100000);
    v.number("inserted_mm", inserted_mm, 1, 3000);
    v.number("speed_mm_per_s", speed_mm_per_s, -200, 200);
  }
};

}  // namespace angio::simulation_settings
