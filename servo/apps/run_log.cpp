// SPDX-License-Identifier: GPL-2.0-or-later
#include "run_log.hpp"
#include "angio/apps/namespace.hpp"

#include <csignal>
#include <iostream>
#include <stdexcept>
#include <utility>

namespace angio::apps {

RunLog::RunLog(Bus& bus, const std::string& path, const std::string& program) : bus_(bus), program_(program) {
  if (path.empty()) return;
  std::signal(SIGXFSZ, SIG_IGN);  // A limit on the size of files is an error of the log, not the end of the loop.
  recording_.emplace(bus, path);
}

void RunLog::watch() {
  if (!recording_ || !recording_->failure() || std::exchange(told_, true)) return;
  std::cerr << program_ << ": " << *recording_->failure() << "\n";
}

void RunLog::finish() {
  if (!recording_) return;
  if (const auto failure = recording_->finish()) {
    std::cout.flush();
    throw std::runtime_error(*failure);
  }
}

}  // namespace angio::apps
