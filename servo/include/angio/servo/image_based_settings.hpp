// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/servo/servo_gain.hpp"

namespace angio::servo {

/// Image-based visual servoing: s are the images of points on the tree's centreline, with the depths that the
/// registration gives them.
struct ImageBasedSettings : ServoGain {
  static constexpr const char* kName = "image_based";

  static constexpr int samples = 40;  ///< Points along the centreline, spread well.
  static constexpr double max_step_deg =
      30;  ///< A goal further away is taken in steps of so much: images know only their like.

  void visit(SettingsVisitor& v) { ServoGain::visit(v); }
};

}  // namespace angio::servo
