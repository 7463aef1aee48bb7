// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>

#include "angio/geometry/carm_limits.hpp"
#include "angio/simulation/command_receiver.hpp"
#include "angio/types/carm_motion.hpp"

namespace angio::simulation {

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
  /// are cut to them. What CommandReceiver does not take is ignored, and the command before it stays in force until it
  /// runs out. An arrival before the present time counts as now.
  void obey(const CArmCommand& command, std::int64_t now_us);

  /// Moves to the time `now_us` [us]; an earlier time than the present is ignored.
  void advance(std::int64_t now_us);

  /// Joints and velocities at the present time. The sequence number is the sender's to fill in.
  CArmState state() const;

  const IgnoredCommands& ignored() const { return receiver_.ignored(); }

  /// How often the last command ran out before another came: the watchdog's stops.
  std::int64_t ranOut() const { return ran_out_; }

 private:
  void move(double duration_s, const CArmJoints& wanted_velocity);

  CArmLimits limits_;
  CommandReceiver receiver_;
  CArmState state_;
  CArmJoints wanted_ = CArmJoints::Zero();
  std::uint64_t valid_left_us_ = 0;
  bool in_force_ = false;  // Whether a command has not run out yet.
  std::int64_t ran_out_ = 0;
};

}  // namespace angio::simulation
