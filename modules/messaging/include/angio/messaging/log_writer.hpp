// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "angio/base/appended_file.hpp"
#include "angio/messaging/log_sink.hpp"

namespace angio::messaging {

struct LogEvent;

/// Writes a log of messages that LogReader, lcm-logplayer and angio-replay read. Every write is checked. When one
/// fails, the log is cut back to its last whole message, and no more are written.
class LogWriter final : public LogSink {
 public:
  /// Replaces a file. Throws InputError that names it: not writable, a full disk, or written by another LogWriter.
  explicit LogWriter(const std::string& path) : file_(path) {}
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;
  ~LogWriter() override { (void)finish(); }

  void write(const std::string& channel, const std::uint8_t* data, std::size_t size) override;

  /// Appends a message of another log, with its number and time.
  void write(const LogEvent& event);

  [[nodiscard]] std::optional<std::string> finish() override;
  const std::optional<std::string>& failure() const override { return failure_; }

 private:
  void fail(const std::string& cause);
  void append(std::int64_t number, std::int64_t time_us, const std::string& channel, const std::uint8_t* data,
              std::size_t size);

  AppendedFile file_;
  std::int64_t messages_ = 0;
  std::optional<std::string> failure_;
};

}  // namespace angio::messaging
