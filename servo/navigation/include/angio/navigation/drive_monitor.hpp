// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <optional>
#include <string>

#include "angio/base/settings.hpp"
#include "angio/messaging/messages.hpp"
#include "angio/servo/axis_monitor.hpp"

namespace angio {

/// What a catheter's drive does with its commands when it is sound.
struct DriveMonitorSettings {
  double most_latency_ms = 500;  ///< From the frame behind a command until its effect ends, without a newer.
  static constexpr double least_acceleration_mm_s2 = 50;  ///< That the drive uses at least.
  static constexpr double least_acceleration_deg_s2 = 500;
  double most_stray_mm = 3;    ///< Pushed or pulled without a command that explains it.
  double most_stray_deg = 20;  ///< Rolled or bent so.
  double most_lag_mm = 10;     ///< Commanded and not made: it is stuck, at its end, or stopped by itself.
  double most_lag_deg = 90;
  static constexpr double forgotten_mm_s = 0.2;  ///< Differences that come more slowly are encoders' noise.
  static constexpr double forgotten_deg_s = 2;

  void visit(SettingsVisitor& v) {
    v.number("most_latency_ms", most_latency_ms, 0, 10e3);
    v.number("most_stray_mm", most_stray_mm, 0.1, 100);
    v.number("most_stray_deg", most_stray_deg, 1, 720);
    v.number("most_lag_mm", most_lag_mm, 0.1, 100);
    v.number("most_lag_deg", most_lag_deg, 1, 720);
  }
};

/// Compares the ways that a catheter's drive pushes, rolls and bends with its commands, see AxisMonitor. Of the
/// catheter's tip, which may well stand still, it says nothing.
class DriveMonitor {
 public:
  using State = CatheterState;
  using Command = CatheterCommand;

  /// @param largest_bend_rad  Where bending ends. Throws InputError when a setting is out of its range.
  DriveMonitor(const DriveMonitorSettings& settings, double largest_bend_rad);

  /// A command that was sent, also one that stands still.
  void commanded(const CatheterCommand& command);

  /// The next state; one that is not newer is ignored. Returns what is wrong with the motion since the last one.
  std::optional<std::string> measured(const CatheterState& state);

  /// Forgets all motion.
  void forget();

 private:
  AxisMonitor insertion_, roll_, bend_;
};

}  // namespace angio
