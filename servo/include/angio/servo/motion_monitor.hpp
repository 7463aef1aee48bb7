// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/geometry/carm_limits.hpp"
#include "angio/servo/namespace.hpp"
#include "angio/types/carm_motion.hpp"

namespace angio::servo {

/// What one axis of a machine can do, and how far it may go otherwise [rad, m, seconds].
struct AxisTraits {
  std::string name;
  bool angle = true;                                                        ///< Its places are angles, else lengths.
  double lower = -std::numeric_limits<double>::infinity(), upper = -lower;  ///< Its range.
  double acceleration = 1;                                                  ///< That it uses at least.
  double deadband_speed = 0;       ///< Differences that come more slowly are encoders' noise.
  double max_deviation = 1;        ///< Motion that no command explains, before it is reported.
  double max_following_error = 1;  ///< Commanded motion that was not made, before it is reported.
  double max_latency_s = 0.5;      ///< From the frame behind a command until its effect ends, without a newer one.
};

/// Compares the motion of an axis with the motions that the commands of the last `max_latency_s` allow.
///
/// Between two states an axis may go as fast as the fastest of those commands (rest is always one of them) or as it
/// still brakes; it must go as fast as the slowest of them, once it could have accelerated, and not at the end of its
/// range. What is beyond is summed up (Page's CUSUM, Biometrika 41, 1954): an axis that moves by itself or the wrong
/// way is found within max_deviation / its speed, one that stands still within max_latency_s, the time to accelerate
/// and max_following_error / the commanded speed. Commands and states are of one clock: a command's time is its
/// frame's.
class AxisMonitor {
 public:
  explicit AxisMonitor(AxisTraits traits) : traits_(std::move(traits)) {}

  /// A velocity that was sent [/s], and for how long it may be obeyed. One whose time is before the last one's counts
  /// as of that time.
  void commanded(std::int64_t time_us, std::int64_t valid_for_us, double velocity);

  /// Where it is at a later time, and how fast. Returns what is wrong with the motion since the last time, or nothing.
  /// A time that is not newer than the last one is ignored; after a gap of a second or more the comparison begins anew.
  std::optional<std::string> measured(std::int64_t time_us, double place, double velocity);

  /// Forgets all motion, for a machine that starts anew.
  void forget();

 private:
  struct Envelope {                 // Of the velocity [rad/s, m/s]:
    double min = 0, max = 0;        // it may be between these,
    double floor = 0, ceiling = 0;  // and must be at least, and at most, this.
  };
  struct Excess {  // Motion beyond the envelope, up and down the axis [rad, m].
    double deviation_up = 0, deviation_down = 0, following_error_up = 0, following_error_down = 0;
  };
  struct Sent {
    std::int64_t time_us, valid_for_us;
    double velocity;
  };
  struct Seen {
    std::int64_t time_us;
    double place;
  };

  Envelope target(std::int64_t time_us) const;
  Envelope explainedMotion(const Seen& now);
  std::optional<std::string> classify(double motion, const Envelope& explained, double duration_s);

  AxisTraits traits_;
  std::deque<Sent> sent_;
  std::optional<Seen> last_;
  Envelope envelope_;
  Excess excess_;
};

/// When a motion counts as one that no command explains, or a command as one that nothing followed.
struct MotionMonitorSettings {
  double max_latency_ms = 500;
  static constexpr double min_acceleration = 0.4;  ///< Share of the acceleration limit that the machine uses at least.
  double max_deviation_deg = 1.0;
  double max_deviation_mm = 5;
  double max_following_error_deg = 4;
  double max_following_error_mm = 20;
  static constexpr double deadband_share =
      0.02;  ///< Of a joint's speed limit: differences that come more slowly are encoders' noise.

  void visit(SettingsVisitor& v) {
    v.number("max_latency_ms", max_latency_ms, 0, 10e3,
             "Time from the frame behind a command until its effect ends, without a newer one");
    v.number("max_deviation_deg", max_deviation_deg, 0.01, 90, "Turn that no command explains, before it is reported");
    v.number("max_deviation_mm", max_deviation_mm, 0.1, 1000, "Shift that no command explains, before it is reported");
    v.number("max_following_error_deg", max_following_error_deg, 0.01, 90,
             "Commanded turn that was not made, before it is reported");
    v.number("max_following_error_mm", max_following_error_mm, 0.1, 1000,
             "Commanded shift that was not made, before it is reported");
  }
};

/// Compares the motion of each joint of the C-arm with its commands, see AxisMonitor.
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
