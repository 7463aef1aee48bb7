// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "angio/messaging/namespace.hpp"

namespace angio::messaging {

/// Writes a log of messages that LogReader, lcm-logplayer and angio-replay read. Every write is checked. When one
/// fails, the log is cut back to its last whole message, and no more are written.
class LogWriter {
 public:
  /// Replaces a file. Throws InputError that names it: not writable, a full disk, or written by another LogWriter.
  explicit LogWriter(const std::string& path);
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;
  ~LogWriter() { (void)finish(); }

  /// Appends a message, with the present time of the wall clock. Does nothing after a failure or finish().
  void write(const std::string& channel, const std::uint8_t* data, std::size_t size);

  /// Waits until the log is on its disk, and closes it. Returns failure().
  [[nodiscard]] std::optional<std::string> finish();

  /// Why messages are missing from the log: one line that names the file, the cause, and how many messages it holds.
  /// Nothing while all were written.
  const std::optional<std::string>& failure() const { return failure_; }

 private:
  void close();
  void fail(int error);

  std::string path_;
  int file_ = -1;  // Negative once it is closed.
  std::int64_t messages_ = 0, bytes_ = 0;
  std::optional<std::string> failure_;
};

}  // namespace angio::messaging
