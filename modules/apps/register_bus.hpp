// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/apps/namespace.hpp"

namespace angio::apps {

/// What registering on a bus needs to know.
struct RegisterBusOptions {
  std::string bus, key_file, tree, calibration, method;
  double duration_s = 0;  ///< 0: until stopped.
  bool point_covariance = false;
};

/// Registers the frames of a bus one after the other, and says so there, until it is stopped. Returns the exit code.
/// Throws InputError.
int registerOnBus(const RegisterBusOptions& o);

}  // namespace angio::apps
