// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <exception>

#include "angio/base/namespace.hpp"

namespace angio::base {

/// Thrown out of work that is given up because the user asked the program to end.
struct Interrupted : std::exception {
  const char* what() const noexcept override { return "interrupted"; }
};

/// While one lives, the first SIGINT or SIGTERM is remembered and does not end the program, so that what is finished
/// can be written. The second one ends it as usual. Not to be nested.
class InterruptionGuard {
 public:
  InterruptionGuard();
  ~InterruptionGuard();
  InterruptionGuard(const InterruptionGuard&) = delete;
  InterruptionGuard& operator=(const InterruptionGuard&) = delete;

 private:
  void (*interrupt_)(int);
  void (*terminate_)(int);
};

/// Returns whether a signal came while a guard lived.
bool interrupted();

/// Throws Interrupted when a signal came while a guard lived.
void throwIfInterrupted();

}  // namespace angio::base
