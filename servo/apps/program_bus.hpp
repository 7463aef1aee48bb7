// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/messaging/authenticated_bus.hpp"
#include "angio/messaging/bus.hpp"
#include "angio/messaging/recording_bus.hpp"
#include "recorded_run.hpp"

namespace angio::apps {

/// The bus of a program, to which bad things may be done on purpose: for trying a set-up before it is trusted.
/// @param url            LCM URL, as openSharedBus() takes it.
/// @param settings_path  What happens to all that this program says (.yaml, DisturbanceSettings), in real time; empty:
///                       nothing.
/// @param key_path       Key file, as AuthenticatedBus takes it; empty: none. The last of all is the envelope.
/// @param program        Its name, for lines on stderr on messages that are refused.
/// Throws InputError as openSharedBus() does, and when a file cannot be read.
std::unique_ptr<Bus> openSharedBus(const std::string& url, const std::string& settings_path,
                                   const std::string& key_path, const std::string& program);

/// The log of a program's run, when one was asked for (--record). A log that can no longer be written ends neither the
/// program nor its loop: the user is told at once, and by the exit code.
class RunLog {
 public:
  /// Borrows the bus. @param path  Empty: no log; .mcap: an MCAP file. @param run  What stands in it beside the
  /// messages, asked for where it is one. Throws InputError when it cannot be written, and as `run` does.
  RunLog(Bus& bus, const std::string& path, const std::string& program, const std::function<RecordedRun()>& run);

  /// What the program is to use: all that it hears and says there is in the log.
  Bus& bus() { return recording_ ? static_cast<Bus&>(*recording_) : bus_; }

  /// Says on stderr, once, that recording has ended early.
  void watch();

  /// Closes the log, and says on stdout how large it is and how fast it grew. Throws std::runtime_error that says why
  /// when messages are missing from it.
  void finish();

 private:
  Bus& bus_;
  std::string path_, program_;
  Stopwatch watch_;
  std::optional<RecordingBus> recording_;
  bool told_ = false;
};

}  // namespace angio::apps
