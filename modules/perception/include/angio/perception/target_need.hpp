// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/perception/namespace.hpp"

namespace angio::perception {

/// The directions in which the target's uncertainty must be small before a task may move the machine.
enum class TargetNeed {
  kAcrossBeam,     ///< In the image. Depth may be open, as one view of a deformed tree leaves it.
  kEverywhere,     ///< Depth included.
  kResolvingDepth  ///< In the image; depth is being found, by frames from several places of the C-arm.
};

}  // namespace angio::perception
