// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cmath>

#include "angio/messaging/messages.hpp"
#include "angio/servo/namespace.hpp"

namespace angio::servo {

/// Whether a command's velocities are finite numbers.
inline bool isFinite(const CArmCommand& command) { return command.velocity.allFinite(); }
inline bool isFinite(const CatheterCommand& command) {
  return std::isfinite(command.insertion_speed_m_per_s) && std::isfinite(command.roll_speed_rad_per_s) &&
         std::isfinite(command.bend_speed_rad_per_s);
}

/// Returns the same command, standing still.
inline CArmCommand atRest(CArmCommand command) {
  command.velocity.setZero();
  return command;
}
inline CatheterCommand atRest(CatheterCommand command) {
  command.insertion_speed_m_per_s = command.roll_speed_rad_per_s = command.bend_speed_rad_per_s = 0;
  command.valid_for_us = 1;  // Nothing is obeyed for longer than it takes to read it.
  return command;
}

}  // namespace angio::servo
