// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/apps/namespace.hpp"

namespace angio::apps {

/// What registering on a bus needs to know.
struct BusOptions {
  std::string bus, tree, calibration, method;
  double duration_s = 0;  ///< 0: until stopped.
};

/// Registers frame after frame, and says so on the bus, until it is stopped. Returns the exit code; throws as
/// PerceptionNode does.
int registerOnBus(const BusOptions& options);

}  // namespace angio::apps
