// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/base/settings.hpp"
#include "angio/simulation/namespace.hpp"

namespace angio::simulation {

/// What an elastic catheter is like beside CatheterSettings; a wall's friction takes the place of `friction` there.
///
/// The defaults are of a microcatheter's soft end: a tube of 0.7 mm outside, 0.45 mm inside and 0.3 GPa has 3 N mm^2.
/// One of 5 French and a braided shaft has some 200 N mm^2 (sources: rod::RodSettings).
struct ElasticCatheterSettings {
  double shaft_bending_n_mm2 = 3;  ///< E I.
  double tip_bending_n_mm2 = 1;    ///< The same of the tip.
  double soft_length_mm = 60;      ///< Behind the tip, over which the stiffness grows from the tip's to the shaft's.
  double wall_friction = 0.05;     ///< Coulomb's coefficient.

  /// Only checks: these are no keys of settings files.
  void visit(SettingsVisitor& v) {
    v.fixed("shaft_bending_n_mm2", shaft_bending_n_mm2, 0.1, 1e4);
    v.fixed("tip_bending_n_mm2", tip_bending_n_mm2, 0.1, 1e4);
    v.fixed("soft_length_mm", soft_length_mm, 1, 1000);
    v.fixed("wall_friction", wall_friction, 0, 0.5);
  }
};

/// What a simulated catheter is like. The defaults are plausible for a steerable microcatheter of 2.1 French; they are
/// nobody's measurement. Bands of platinum and iridium, or of gold, are what marks catheters' tips under fluoroscopy
/// (Medical Design Briefs, The benefits of embedding marker bands vs. swaging); the band's length and opacity are ours.
struct CatheterSettings {
  double diameter_mm = 0.7;
  double attenuation_per_m = 300;
  double marker_length_mm = 1.5;
  double tip_length_mm = 6;
  double tip_angle_deg = 25;
  double max_bend_deg = 90;
  double roll_zero_deg = 0;
  double length_mm = 1500;
  std::optional<ElasticCatheterSettings> elastic;  ///< Nothing: the body is kinematic.

  double insertion_backlash_mm = 0.6;
  double roll_backlash_deg = 6;
  double bend_backlash_deg = 2;
  static constexpr double slack_mm_per_rad = 0.1;  ///< Between the inner and the outer wall, for each radian of bends.
  double friction = 0.02;
  static constexpr double drag_n_per_m = 0.5;  ///< Of a straight catheter.
  static constexpr double wind_up_deg_per_m =
      60;  ///< Of the shaft, before the tip turns; it grows with bends as friction does.
  static constexpr double unwind_mm = 20;           ///< Sliding that lets two thirds of the wind-up out.
  static constexpr double stiffness_n_per_m = 400;  ///< Of the catheter in compression.
  double buckling_force_n = 1;
  static constexpr double tip_stiffness_n_per_rad = 0.05;  ///< Of the tip against its bend.
  static constexpr double contact_force_n = 0.05;          ///< At the tip, from where it counts as a contact.
  static constexpr double cone_deg = 70;  ///< A tip that points further beside a branch's lumen does not enter it.

  double max_insertion_speed_mm_per_s = 30;
  double max_roll_speed_deg_per_s = 360;
  double max_bend_speed_deg_per_s = 90;

  void visit(SettingsVisitor& v) {
    v.number("diameter_mm", diameter_mm, 0.1, 5, "Diameter of the catheter");
    v.number("attenuation_per_m", attenuation_per_m, 0, 1e4,
             "Linear attenuation above that of blood: a braid and a filled wall");
    v.number("marker_length_mm", marker_length_mm, 0, 50, "Length of the platinum marker at the tip");
    v.number("tip_length_mm", tip_length_mm, 1, 50, "Length of the tip from its bend to its end");
    v.number("tip_angle_deg", tip_angle_deg, 0, 120, "Angle of the tip as it was shaped");
    v.number("max_bend_deg", max_bend_deg, 0, 120, "Largest bend that steering adds; 0: it cannot be steered");
    v.number("roll_zero_deg", roll_zero_deg, -360, 360,
             "Where the bend points when the drive's roll is 0: nobody tells the loop");
    v.number("length_mm", length_mm, 10, 5000, "Length that the drive can push in");
    v.number("insertion_backlash_mm", insertion_backlash_mm, 0, 20, "Backlash of the insertion");
    v.number("roll_backlash_deg", roll_backlash_deg, 0, 180, "Backlash of the roll");
    v.number("bend_backlash_deg", bend_backlash_deg, 0, 60, "Backlash of the bend");
    v.number("friction", friction, 0, 0.5, "Coulomb's coefficient of friction between catheter and wall");
    v.number("buckling_force_n", buckling_force_n, 0.01, 100, "Largest force that can be pushed through the catheter");
    v.number("max_insertion_speed_mm_per_s", max_insertion_speed_mm_per_s, 0.1, 200, "Largest speed of the insertion");
    v.number("max_roll_speed_deg_per_s", max_roll_speed_deg_per_s, 1, 3600, "Largest speed of the roll");
    v.number("max_bend_speed_deg_per_s", max_bend_speed_deg_per_s, 1, 720, "Largest speed of the bend");
    if (elastic) elastic->visit(v);
  }
};

}  // namespace angio::simulation
