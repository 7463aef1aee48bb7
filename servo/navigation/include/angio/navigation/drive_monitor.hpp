// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/base/settings.hpp"
#include "angio/navigation/namespace.hpp"
#include "angio/servo/motion_monitor.hpp"
#include "angio/types/any_message.hpp"

namespace angio::navigation {

/// What a catheter's drive does with its commands when it is sound.
struct DriveMonitorSettings {
  double max_latency_ms = 500;
  static constexpr double min_acceleration_mm_per_s2 = 50;  ///< That the drive uses at least.
  static constexpr double min_acceleration_deg_per_s2 = 500;
  double max_deviation_mm = 3;
  double max_deviation_deg = 20;
  double max_following_error_mm = 10;
  double max_following_error_deg = 90;
  static constexpr double deadband_mm_per_s = 0.2;  ///< Differences that come more slowly are encoders' noise.
  static constexpr double deadband_deg_per_s = 2;

  void visit(SettingsVisitor& v) {
    v.number("max_latency_ms", max_latency_ms, 0, 10e3,
             "Time from the frame behind a command until its effect ends, without a newer one");
    v.number("max_deviation_mm", max_deviation_mm, 0.1, 100,
             "Pushed or pulled without a command that explains it, before it is reported");
    v.number("max_deviation_deg", max_deviation_deg, 1, 720,
             "Rolled or bent without a command that explains it, before it is reported");
    v.number("max_following_error_mm", max_following_error_mm, 0.1, 100,
             "Commanded push or pull that was not made, before it is reported: the catheter is stuck, at its end, or "
             "stopped by itself");
    v.number("max_following_error_deg", max_following_error_deg, 1, 720,
             "Commanded roll or bend that was not made, before it is reported");
  }
};

/// Compares how a catheter's drive pushes, rolls and bends with its commands, see AxisMonitor. Of the
/// catheter's tip, which may well stand still, it says nothing.
class DriveMonitor {
 public:
  using State = CatheterState;
  using Command = CatheterCommand;

  /// @param max_bend_rad  Where bending ends. Throws InputError when a setting is out of its range.
  DriveMonitor(const DriveMonitorSettings& settings, double max_bend_rad);

  /// A command that was sent, also one that stands still.
  void commanded(const CatheterCommand& command);

  /// The next state; one that is not newer is ignored. Returns what is wrong with the motion since the last one.
  std::optional<std::string> measured(const CatheterState& state);

  /// Forgets all motion.
  void forget();

 private:
  AxisMonitor insertion_, roll_, bend_;
};

}  // namespace angio::navigation
