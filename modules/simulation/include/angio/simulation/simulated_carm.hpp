// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>

#include "angio/base/settings.hpp"
#include "angio/geometry/carm_limits.hpp"
#include "angio/types/carm_motion.hpp"

namespace angio {

/// How many commands a simulated C-arm did not obey, by the reason; each is counted once, by the first that applies.
struct IgnoredCommands {
  std::int64_t not_finite = 0;       ///< A velocity was NaN or infinite.
  std::int64_t bad_validity = 0;     ///< valid_for_us was not in (0, 1 s].
  std::int64_t out_of_sequence = 0;  ///< Neither a higher sequence than the last one obeyed, nor a later time.
  std::int64_t too_old = 0;          ///< The frame behind it was too long ago, or still to come.
  std::int64_t wrong_unit = 0;       ///< So far beyond a speed limit that its numbers mean something else.

  std::int64_t total() const { return not_finite + bad_validity + out_of_sequence + too_old + wrong_unit; }
};

/// What a receiver asks of a command before it moves by it: the last gate, for it alone sees what arrives and when.
struct ReceiverSettings {
  double most_command_age_ms = 300;   ///< Since the frame behind it, by the arm's clock, which is the frames'.
  double most_command_lead_ms = 100;  ///< That its frame may be ahead of the arm's clock.
  static constexpr double most_overspeed =
      10;  ///< Times a speed limit: less is cut to the limit, more is in wrong units.

  void visit(SettingsVisitor& v) {
    v.number("most_command_age_ms", most_command_age_ms, 1, 60e3);
    v.number("most_command_lead_ms", most_command_lead_ms, 0, 60e3);
  }
};

/// A C-arm whose joints follow commanded velocities within their range, speed and acceleration, and come to rest by
/// themselves when the last command has run out: silence means stop.
///
/// Motion between two times is exact (pieces of constant acceleration), so it does not depend on how often `advance` is
/// called. Each joint brakes in front of the end of its range, and stops there without passing it.
class SimulatedCArm {
 public:
  /// At rest at `start` at the time `now_us` [us]. Throws InputError when a limit is not finite, a speed or
  /// acceleration not positive, a range empty, or `start` outside the range.
  SimulatedCArm(const CArmLimits& limits, const CArmJoints& start, std::int64_t now_us,
                const ReceiverSettings& receiver = {});

  /// Takes a command that arrives at `now_us` [us] and holds for its validity from then on; speeds beyond the limits
  /// are cut to them. A command that is not finite, not newer than the last one, or whose validity is not in (0, 1 s]
  /// is ignored, and so is one that breaks the receiver's settings; the one before it stays in force until it runs out.
  /// A command that stands still is never too old. An arrival before the present time counts as now.
  void obey(const CArmCommand& command, std::int64_t now_us);

  /// Moves to the time `now_us` [us]; an earlier time than the present is ignored.
  void advance(std::int64_t now_us);

  /// Joints and velocities at the present time. The sequence number is the sender's to fill in.
  CArmState state() const;

  const IgnoredCommands& ignored() const { return ignored_; }

  /// How often the last command ran out before another came: the watchdog's stops.
  std::int64_t ranOut() const { return ran_out_; }

 private:
  bool newer(const CArmCommand& command) const;
  bool ofNow(const CArmCommand& command) const;
  void move(double duration_s, const CArmJoints& wanted_velocity);

  CArmLimits limits_;
  ReceiverSettings receiver_;
  CArmState state_;
  CArmJoints wanted_ = CArmJoints::Zero();
  std::uint64_t valid_left_us_ = 0;
  bool in_force_ = false;   // Whether a command has not run out yet.
  bool commanded_ = false;  // Whether last_sequence_ means anything yet.
  std::int64_t last_sequence_ = 0;
  std::int64_t last_command_us_ = 0;
  IgnoredCommands ignored_;
  std::int64_t ran_out_ = 0;
};

}  // namespace angio
