// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/servo/servo_gain.hpp"

namespace angio::servo {

/// 2 1/2 D visual servoing: s = (the target's image x, y; log(Z / Z*); theta u of cdRc). The target goes straight to
/// its place in the image, whatever the rotation does.
struct HybridSettings : ServoGain {
  static constexpr const char* kName = "hybrid";
};

}  // namespace angio::servo
