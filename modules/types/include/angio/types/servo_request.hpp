// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>

#include "angio/types/namespace.hpp"

namespace angio::types {

enum class ServoRequestKind : std::int8_t { kStop = 0, kArm = 1, kStart = 2, kReset = 3, kEmergencyStop = 4 };
constexpr int kServoRequestKindCount = 5;

/// What the operator asks of the loop, and which status was seen when it was asked. The default stops.
struct ServoRequest {
  std::int64_t time_us = 0;         ///< When it was asked, sender's monotonic clock [us].
  std::int64_t sequence = 0;        ///< Rises by one per request.
  std::int64_t status_time_us = 0;  ///< Of the last status seen; 0: none.
  std::int64_t transitions = 0;     ///< Of that status.
  ServoRequestKind request = ServoRequestKind::kStop;
};

}  // namespace angio::types
