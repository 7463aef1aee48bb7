// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// Several starts against local minima: the prior's pose and draws around it.
struct StartSettings {
  int count = 0;  ///< Starts in all, the first is the prior's pose; 0: as many as the method thinks right.
  double rotation_std_deg =
      2;  ///< Spread of the draws, per axis, about the tree's centroid; when the prior says nothing.
  double translation_std_mm = 5;  ///< Per axis.
  int seed = 1;

  // A box around the prior's pose that is searched as a whole, when one of them is not 0: +- so much about and along
  // each axis.
  double box_rotation_deg = 0;
  double box_translation_mm = 0;

  bool box() const { return box_rotation_deg > 0 || box_translation_mm > 0; }

  void visit(SettingsVisitor& v) {
    v.integer("count", count, 0, 100000);
    v.number("rotation_std_deg", rotation_std_deg, 0, 180);
    v.number("translation_std_mm", translation_std_mm, 0, 1000);
    v.integer("seed", seed, 0, 2147483647);
    v.number("box_rotation_deg", box_rotation_deg, 0, 180);
    v.number("box_translation_mm", box_translation_mm, 0, 1000);
  }
};

}  // namespace angio::registration
