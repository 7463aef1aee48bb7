// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "angio/base/settings.hpp"
#include "angio/messaging/messages.hpp"

namespace angio {

struct MotionMonitorSettings {
  double most_latency_ms = 500;     ///< From the frame behind a command until its effect ends, without a newer one.
  double least_acceleration = 0.4;  ///< Share of the acceleration limit that the machine uses at least.
  double most_stray_deg = 1.0;      ///< Way that no command explains, until a joint counts as astray.
  double most_stray_mm = 5;
  double most_lag_deg = 4;  ///< Way that was commanded and not made, until a joint counts as stalled.
  double most_lag_mm = 20;
  double forgotten_share = 0.02;  ///< Of a joint's speed limit: differences that come more slowly are encoders' noise.

  void visit(SettingsVisitor& v) {
    v.number("most_latency_ms", most_latency_ms, 0, 10e3);
    v.number("least_acceleration", least_acceleration, 0.01, 1);
    v.number("most_stray_deg", most_stray_deg, 0.01, 90);
    v.number("most_stray_mm", most_stray_mm, 0.1, 1000);
    v.number("most_lag_deg", most_lag_deg, 0.01, 90);
    v.number("most_lag_mm", most_lag_mm, 0.1, 1000);
    v.number("forgotten_share", forgotten_share, 0, 1);
  }
};

/// Compares the way that each joint makes with the ways that the commands of the last `most_latency_ms` allow.
///
/// Between two states a joint may go as fast as the fastest of those commands (rest is always one of them) or as it
/// still brakes; it must go as fast as the slowest of them, once it could have accelerated, and not at the end of its
/// range. What is beyond is summed up (Page's CUSUM, Biometrika 41, 1954): a joint that moves by itself or the wrong
/// way is found within most_stray / its speed, one that stands still within most_latency_ms, the time to accelerate and
/// most_lag / the commanded speed. Commands and states are of one clock: a command's time is its frame's.
class MotionMonitor {
 public:
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
  struct Envelope {                 // Of one joint's velocity [rad/s, m/s]:
    double most = 0, least = 0;     // it may be between these,
    double floor = 0, ceiling = 0;  // and must be at least, and at most, this.
  };
  struct Astray {  // Ways beyond the envelope [rad, m].
    double up = 0, down = 0, lag_up = 0, lag_down = 0;
  };
  struct Sent {
    std::int64_t time_us, valid_for_us;
    CArmJoints velocity;
  };

  Envelope target(int joint, std::int64_t time_us) const;
  Envelope explainedWay(int joint, const CArmState& state);
  std::optional<std::string> judge(int joint, double way, const Envelope& explained, double duration_s);

  MotionMonitorSettings settings_;
  CArmLimits limits_;
  std::deque<Sent> sent_;
  std::optional<CArmState> last_;
  std::array<Envelope, kCArmJointCount> envelopes_{};
  std::array<Astray, kCArmJointCount> astray_{};
};

}  // namespace angio
