// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/navigation/namespace.hpp"

namespace angio::navigation {

/// What the navigator knows of its catheter, and how carefully it goes.
struct NavigatorSettings {
  // The catheter, by its data sheet.
  double tip_length_mm = 6;
  double tip_angle_deg = 25;                   ///< As it was shaped.
  double max_bend_deg = 90;                    ///< That steering adds; 0: it cannot be steered.
  static constexpr double dead_band_deg = 30;  ///< Of roll, between drive and tip, from one side to the other.

  // Speeds.
  double speed_mm_per_s = 12;
  double fork_speed_mm_per_s = 4;  ///< Within `slow_mm` of a fork, and across it.
  double back_speed_mm_per_s = 8;
  double roll_speed_deg_per_s = 120;
  double bend_speed_deg_per_s = 60;
  double valid_for_ms = 300;  ///< How long a command may be obeyed.

  // Forks.
  static constexpr double slow_mm = 12;
  static constexpr double aim_mm = 4;      ///< Before a fork, the tip is aimed.
  static constexpr double confirm_mm = 2;  ///< Beyond where its branches part, one of them counts as entered.
  static constexpr double sure_mm = 10;    ///< Beyond there, even a doubtful belief of a wrong branch counts.
  static constexpr double short_mm =
      9;  ///< Forks that follow each other closer than that are aimed for together where one aim serves.
  static constexpr double back_mm = 6;     ///< Before it, another try begins.
  static constexpr double lever_mm = 5.5;  ///< Along which a branch's direction is taken, give or take a third.
  static constexpr double angle_deg = 8;   ///< Of the tip, good enough.
  static constexpr double look_std_deg =
      35;          ///< Less sure of the tip's angle than that, it is turned once around to be seen.
  int tries = 10;  ///< At one fork.

  // Doubts.
  static constexpr double min_probability = 0.6;  ///< Of the branch; below, it stops and waits.
  static constexpr double max_std_mm = 5;         ///< Of the place along it; above, it stops and waits.
  static constexpr double patience_s = 2;         ///< Then it pulls back slowly, as far as `retreat_mm`.
  static constexpr double retreat_mm = 25;
  double max_force_n = 0.8;               ///< At the drive; above, it pulls back.
  static constexpr double stall_mm = 12;  ///< Pushed or pulled without the tip's following: it stands against a wall.

  void visit(SettingsVisitor& v) {
    v.number("tip_length_mm", tip_length_mm, 1, 50);
    v.number("tip_angle_deg", tip_angle_deg, 0, 120);
    v.number("max_bend_deg", max_bend_deg, 0, 120);
    v.number("speed_mm_per_s", speed_mm_per_s, 0.1, 50);
    v.number("fork_speed_mm_per_s", fork_speed_mm_per_s, 0.1, 50);
    v.number("back_speed_mm_per_s", back_speed_mm_per_s, 0.1, 50);
    v.number("roll_speed_deg_per_s", roll_speed_deg_per_s, 1, 720);
    v.number("bend_speed_deg_per_s", bend_speed_deg_per_s, 1, 720);
    v.number("valid_for_ms", valid_for_ms, 20, 1000);
    v.integer("tries", tries, 1, 100);
    v.number("max_force_n", max_force_n, 0.01, 20);
  }
};

}  // namespace angio::navigation
