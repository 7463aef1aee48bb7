// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "angio/messaging/namespace.hpp"

namespace angio::mcap {
class Reader;
}

namespace angio::messaging {

/// One message of a log.
struct LogEvent {
  std::int64_t number = 0;          ///< The logger's, rising by one.
  std::int64_t time_us = 0;         ///< When the logger heard it, wall clock [us].
  std::int64_t position_bytes = 0;  ///< Where it stands in the file; of an MCAP file, in its unpacked records.
  std::string channel;
  std::vector<std::uint8_t> bytes;
};

/// Reads a log of lcm-logger, or one that openBus("file://...?mode=w") recorded, or the LCM messages of an MCAP file,
/// with the times at which messages were heard (a file:// bus has none) and from bytes that may come from anywhere:
/// what lies in the file's own length fields is checked against the file before anything is allocated.
class LogReader {
 public:
  /// Throws InputError that names the file when it cannot be read.
  explicit LogReader(const std::string& path);
  LogReader(const LogReader&) = delete;
  LogReader& operator=(const LogReader&) = delete;
  ~LogReader();

  /// The next message, or nothing at the end. Damage is skipped up to the next message.
  std::optional<LogEvent> next();

  /// The next message will be the first one at or behind `position_bytes`, 0 to size_bytes().
  void seek(std::int64_t position_bytes);

  /// How much of the file was no message, so far [bytes]; a logger that was killed leaves a piece of one at the end.
  std::int64_t skipped_bytes() const { return skipped_; }

  std::int64_t size_bytes() const { return size_; }          ///< Of the file, or of an MCAP file's unpacked records.
  std::int64_t position_bytes() const { return position_; }  ///< Up to where it has been read.

  /// Whether the log has no end of its own to miss: no for an MCAP file whose recording was cut.
  bool whole() const;

 private:
  std::optional<LogEvent> nextOfMcap();
  void skipDamage();

  std::unique_ptr<mcap::Reader> mcap_;  // None for a log of LCM's.

  std::ifstream file_;
  std::int64_t size_ = 0, position_ = 0, skipped_ = 0;
};

/// The file of a URL "file://x.lcm?speed=0", which is to be read as fast as it goes; nothing for any other.
std::optional<std::string> logFileOf(const std::string& url);

}  // namespace angio::messaging
