// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/servo/servo_gain.hpp"

namespace angio::servo {

/// Position-based visual servoing: s = (cdtc, theta u of cdRc), s* = 0.
struct PositionBasedSettings : ServoGain {
  static constexpr const char* kName = "position_based";
};

}  // namespace angio::servo
