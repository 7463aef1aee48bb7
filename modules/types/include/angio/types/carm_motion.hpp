// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>

#include "angio/geometry/carm.hpp"
#include "angio/types/namespace.hpp"

namespace angio::types {

/// Joints of the C-arm as its encoders read them.
struct CArmState {
  std::int64_t time_us = 0;                  ///< When the encoders were read, sender's monotonic clock [us].
  std::int64_t sequence = 0;                 ///< Rises by one per message.
  CArmJoints joints = CArmJoints::Zero();    ///< rad, rad, m, m, m.
  CArmJoints velocity = CArmJoints::Zero();  ///< rad/s, rad/s, m/s, m/s, m/s.
};

/// Velocity command for the C-arm's joints. The default stands still.
struct CArmCommand {
  std::int64_t time_us = 0;                  ///< Exposure time of the frame behind this command [us].
  std::int64_t sequence = 0;                 ///< Rises by one per command.
  std::int64_t frame_sequence = 0;           ///< The frame it answers.
  std::int64_t valid_for_us = 0;             ///< How long it may be obeyed after it arrives [us]; silence means stop.
  CArmJoints velocity = CArmJoints::Zero();  ///< rad/s, rad/s, m/s, m/s, m/s.
};

}  // namespace angio::types
