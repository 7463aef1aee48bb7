// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cmath>

#include "angio/messaging/messages.hpp"

namespace angio {

/// Whether a command's velocities are finite numbers.
inline bool isFinite(const CArmCommand& command) { return command.velocity.allFinite(); }
inline bool isFinite(const CatheterCommand& command) {
  return std::isfinite(command.insertion_speed_mps) && std::isfinite(command.roll_speed_radps) &&
         std::isfinite(command.bend_speed_radps);
}

/// Returns the same command, standing still.
inline CArmCommand atRest(CArmCommand command) {
  command.velocity.setZero();
  return command;
}
inline CatheterCommand atRest(CatheterCommand command) {
  command.insertion_speed_mps = command.roll_speed_radps = command.bend_speed_radps = 0;
  command.valid_for_us = 1;  // Nothing is obeyed for longer than it takes to read it.
  return command;
}

}  // namespace angio
