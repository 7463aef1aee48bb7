// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "angio/servo/namespace.hpp"

namespace angio::servo {

/// What one axis of a machine can do, and how far it may go otherwise [rad, m, seconds].
struct AxisTraits {
  std::string name;
  bool angle = true;                                                        ///< Its places are angles, else lengths.
  double lower = -std::numeric_limits<double>::infinity(), upper = -lower;  ///< Its range.
  double acceleration = 1;                                                  ///< That it uses at least.
  double deadband_speed = 0;       ///< Differences that come more slowly are encoders' noise.
  double max_deviation = 1;        ///< Way that no command explains, until it counts as astray.
  double max_following_error = 1;  ///< Way that was commanded and not made, until it counts as stalled.
  double max_latency_s = 0.5;      ///< From the frame behind a command until its effect ends, without a newer one.
};

/// Compares the way that an axis makes with the ways that the commands of the last `max_latency_s` allow.
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
    double most = 0, least = 0;     // it may be between these,
    double floor = 0, ceiling = 0;  // and must be at least, and at most, this.
  };
  struct Astray {  // Ways beyond the envelope [rad, m].
    double up = 0, down = 0, lag_up = 0, lag_down = 0;
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
  Envelope explainedWay(const Seen& now);
  std::optional<std::string> judge(double way, const Envelope& explained, double duration_s);

  AxisTraits traits_;
  std::deque<Sent> sent_;
  std::optional<Seen> last_;
  Envelope envelope_;
  Astray deviation_;
};

}  // namespace angio::servo
