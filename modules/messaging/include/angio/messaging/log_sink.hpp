// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "angio/messaging/namespace.hpp"

namespace angio::messaging {

/// What a party's messages are written down in, whatever the format of the file. When a message cannot be written, the
/// log keeps those before it, and no more are written.
class LogSink {
 public:
  virtual ~LogSink() = default;

  /// Appends a message, with the present time of the wall clock. Does nothing after a failure or finish().
  virtual void write(const std::string& channel, const std::uint8_t* data, std::size_t size) = 0;

  /// Waits until the log is on its disk, and closes it. Returns failure().
  [[nodiscard]] virtual std::optional<std::string> finish() = 0;

  /// Why messages are missing from the log: one line that names the file, the cause, and how many messages it holds.
  /// Nothing while all were written.
  virtual const std::optional<std::string>& failure() const = 0;
};

/// The wall clock [us since 1970], as logs have it.
std::int64_t wallClock_us();

}  // namespace angio::messaging
