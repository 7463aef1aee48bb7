// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>

#include "angio/types/namespace.hpp"

namespace angio::types {

/// A loop's session, announced when it is armed: from now on, the machine's commands are this sender's, and their
/// sequence numbers go on from `command_sequence`.
struct ServoSession {
  std::int64_t time_us = 0;           ///< When it was announced, the loop's clock [us].
  std::int64_t sequence = 0;          ///< Rises by one per announcement.
  std::int64_t session = 0;           ///< Its number; none of the last sessions' on the bus.
  std::int64_t command_sequence = 0;  ///< Of the loop's last command before it.
};

}  // namespace angio::types
