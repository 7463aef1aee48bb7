// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/interruption.hpp"

#include <csignal>

namespace angio::base {
namespace {

volatile std::sig_atomic_t came = 0;

void remember(int signal) {
  came = 1;
  std::signal(signal, SIG_DFL);
}

}  // namespace

InterruptionGuard::InterruptionGuard()
    : interrupt_(std::signal(SIGINT, remember)), terminate_(std::signal(SIGTERM, remember)) {}

InterruptionGuard::~InterruptionGuard() {
  std::signal(SIGINT, interrupt_);
  std::signal(SIGTERM, terminate_);
}

bool interrupted() { return came != 0; }

void throwIfInterrupted() {
  if (interrupted()) throw Interrupted();
}

}  // namespace angio::base
