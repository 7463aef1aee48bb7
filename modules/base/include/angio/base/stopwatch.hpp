// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <chrono>

#include "angio/base/namespace.hpp"

namespace angio::base {

/// Wall time since it was made. For reports only: no command may depend on it.
class Stopwatch {
 public:
  /// Seconds since construction [s].
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count(); }

 private:
  std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
};

}  // namespace angio::base
