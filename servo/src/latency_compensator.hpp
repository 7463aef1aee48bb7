// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>

#include "angio/geometry/carm.hpp"
#include "angio/servo/task.hpp"

namespace angio::servo {

/// The commands that were given and do not move the machine yet: what a loop with a latency has to know of itself.
/// Source: O. J. M. Smith, Closer control of loops with dead time, Chem. Eng. Progress 53 (1957).
class LatencyCompensator {
 public:
  explicit LatencyCompensator(const CArmLimits& limits) : limits_(limits) {}

  /// Takes note of the command before this frame, and says where the joints will be, and how fast, when this frame's
  /// command begins to move them: commands act `latency_s` after their frames, and joints follow with their
  /// acceleration.
  CArmState atArrival(const TaskInput& input);

  /// How the last command's velocity differed from the one before it; zero after a hold.
  const CArmJoints& lastChange() const { return last_change_; }

  /// A frame was answered by a hold.
  void interrupt() {
    interrupted_ = true;
    last_velocity_.setZero();
  }

 private:
  struct Command {
    double frame_time_s;
    CArmJoints velocity;
  };
  CArmLimits limits_;
  std::deque<Command> commands_;  // Oldest first.
  CArmJoints last_velocity_ = CArmJoints::Zero(), last_change_ = CArmJoints::Zero();
  double last_frame_s_ = 0;
  bool interrupted_ = false;
};

}  // namespace angio::servo
