// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <chrono>

#include "angio/cli/namespace.hpp"

namespace angio::cli {

/// Exit code of work that was done as asked and did not reach what it is for: a registration that did not converge, a
/// loop that never moved.
constexpr int kExitNotReached = 3;

/// How long a program listens: until its time is over, or SIGINT or SIGTERM has come.
class RunTime {
 public:
  /// Takes the signals over. @param duration_s  0: without an end of its own.
  explicit RunTime(double duration_s = 0);

  bool over() const;
  double elapsed_s() const;

  /// Ends it as a signal does.
  static void end();

 private:
  double duration_s_;
  std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
};

}  // namespace angio::cli
