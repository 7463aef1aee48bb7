// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <iostream>

#include "angio/calibration/namespace.hpp"

namespace angio::calibration {

/// While it lives, nothing reaches stdout: for calls into libraries that print. Holds for the whole process.
class Silence {
 public:
  Silence() {
    flush();
    before_ = dup(STDOUT_FILENO);
    const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (before_ >= 0 && nowhere >= 0) dup2(nowhere, STDOUT_FILENO);
    if (nowhere >= 0) close(nowhere);
  }
  Silence(const Silence&) = delete;
  Silence& operator=(const Silence&) = delete;
  ~Silence() {
    flush();
    if (before_ < 0) return;
    dup2(before_, STDOUT_FILENO);
    close(before_);
  }

 private:
  static void flush() {
    std::cout.flush();
    std::fflush(stdout);
  }

  int before_ = -1;
};

}  // namespace angio::calibration
