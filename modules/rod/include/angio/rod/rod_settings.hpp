// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/rod/namespace.hpp"

namespace angio::rod {

/// What an elastic catheter is made of, and the wall.
///
/// The bending stiffness is a tube's by its dimensions: of 5 French, 1.67 mm outside and 1.0 mm inside, the second
/// moment of area is 0.33 mm^4, and with a modulus of 0.6 GPa, as of braided polyamide, it has 2e-4 N m^2. That of the
/// tip, the friction and the wall's stiffness are assumptions: a tip is several times softer than its shaft, a wet
/// coated catheter slides with a coefficient below 0.1 (what K. Takashima et al., Tribology International 40(2), 2007,
/// measure depends on coat and load), and the wall's stiffness is of the order of an artery's circumferential modulus.
/// None of them was measured on a catheter at hand.
struct RodSettings {
  double radius_m = 0.835e-3;
  double shaft_bending_n_m2 = 2e-4;
  double tip_bending_n_m2 = 4e-5;
  double soft_length_m =
      60e-3;  ///< Over which the shaft becomes as soft as the tip, which is as soft in all its length.
  double tip_length_m = 15e-3;   ///< From the middle of its bend to its end.
  double bend_length_m = 6e-3;   ///< Of the bend: by its shape, and by steering.
  double twist_per_bending = 1;  ///< G J / E I: 0.77 of a plain tube with a Poisson's ratio of 0.3, more with a braid.
  double stretching_n = 200;     ///< E A.
  double friction = 0.05;
  double wall_pa = 5e5;         ///< Force for each metre of rod and metre of depth in the wall.
  double end_wall_m = 3e-3;     ///< Length of rod that has as much wall to press on as its end.
  double spacing_m = 3e-3;      ///< Of its points along the shaft.
  double tip_spacing_m = 1e-3;  ///< The same along the tip.

  /// Only checks: these are no keys of settings files.
  void visit(SettingsVisitor& v) {
    v.fixed("radius_m", radius_m, 1e-4, 5e-3);
    v.fixed("shaft_bending_n_m2", shaft_bending_n_m2, 1e-8, 1);
    v.fixed("tip_bending_n_m2", tip_bending_n_m2, 1e-8, 1);
    v.fixed("soft_length_m", soft_length_m, 1e-3, 1);
    v.fixed("tip_length_m", tip_length_m, 1e-3, 0.1);
    v.fixed("bend_length_m", bend_length_m, 1e-4, 2 * tip_length_m);
    v.fixed("twist_per_bending", twist_per_bending, 0.1, 100);
    v.fixed("stretching_n", stretching_n, 1, 1e6);
    v.fixed("friction", friction, 0, 1);
    v.fixed("wall_pa", wall_pa, 1e3, 1e10);
    v.fixed("end_wall_m", end_wall_m, 0, 0.1);
    v.fixed("spacing_m", spacing_m, 1e-4, 0.05);
    v.fixed("tip_spacing_m", tip_spacing_m, 1e-4, 0.05);
  }
};

}  // namespace angio::rod
