// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/apps/namespace.hpp"
#include "findings.hpp"

namespace angio::apps {

/// Which bus is listened to, and what its frames are compared with.
struct BusToInspect {
  std::string bus, tree, calibration, picture;  ///< LCM URL or log; files; the picture may be empty.
  double wait_s = 5;                            ///< For a frame and the joints of its exposure.
};

/// Says what the newest X-ray frame of a bus says of itself, whether that agrees with the calibration, how old it is
/// and what should be at its edges; of a log, the last frame. Writes the picture, with the tree where joints and
/// calibration have it.
///
/// Throws InputError that names what cannot be read, and std::runtime_error when no frame has come.
Findings inspectBus(const BusToInspect& o);

}  // namespace angio::apps
