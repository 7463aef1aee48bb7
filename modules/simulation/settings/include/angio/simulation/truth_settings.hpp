// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/simulation_settings/namespace.hpp"

namespace angio::simulation_settings {

/// What counts as visible.
struct TruthSettings {
  /// A vessel is seen when what it takes from the beam, over the quantum noise of a square as wide as it is, exceeds
  /// this: Rose's criterion, 3 to 5 (Rose, J Opt Soc Am 38, 1948).
  double min_contrast_to_noise = 4;
  double spacing_px = 1;  ///< Between points of the centrelines.
  double min_px = 8;      ///< Shorter visible pieces are left out.

  void visit(SettingsVisitor& v) { v.number("spacing_px", spacing_px, 0.2, 50); }
};

}  // namespace angio::simulation_settings
