// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/geometry/carm_limits.hpp"
#include "angio/servo/axis_monitor.hpp"
#include "angio/types/carm_motion.hpp"

namespace angio::servo {

struct MotionMonitorSettings {
  double max_latency_ms = 500;  ///< From the frame behind a command until its effect ends, without a newer one.
  static constexpr double min_acceleration = 0.4;  ///< Share of the acceleration limit that the machine uses at least.
  double max_deviation_deg = 1.0;                  ///< Way that no command explains, until a joint counts as astray.
  double max_deviation_mm = 5;
  double max_following_error_deg = 4;  ///< Way that was commanded and not made, until a joint counts as stalled.
  double max_following_error_mm = 20;
  static constexpr double deadband_share =
      0.02;  ///< Of a joint's speed limit: differences that come more slowly are encoders' noise.

  void visit(SettingsVisitor& v) {
    v.number("max_latency_ms", max_latency_ms, 0, 10e3);
    v.number("max_deviation_deg", max_deviation_deg, 0.01, 90);
    v.number("max_deviation_mm", max_deviation_mm, 0.1, 1000);
    v.number("max_following_error_deg", max_following_error_deg, 0.01, 90);
    v.number("max_following_error_mm", max_following_error_mm, 0.1, 1000);
  }
};

/// Compares the way that each joint of the C-arm makes with its commands, see AxisMonitor.
class MotionMonitor {
 public:
  using State = CArmState;
  using Command = CArmCommand;

  /// Throws InputError when a setting is out of its range.
  MotionMonitor(const MotionMonitorSettings& settings, const CArmLimits& limits);

  /// A command that was sent. One whose time is before the last one's counts as of that time.
  void commanded(const CArmCommand& command);

  /// The next state. Returns what is wrong with the motion since the last one, or nothing. A state that is not newer
  /// than the last one is ignored; after a gap of a second or more the comparison begins anew.
  std::optional<std::string> measured(const CArmState& state);

  /// Forgets all motion, for a machine that starts anew.
  void forget();

 private:
  std::vector<AxisMonitor> joints_;
};

}  // namespace angio::servo
