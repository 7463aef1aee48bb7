// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "angio/messaging/bus.hpp"
#include "angio/messaging/log_sink.hpp"

namespace angio::messaging {

/// Writes all that one party hears and says, in that order, into a log that angio-replay reads. A channel counts as
/// heard while somebody listens to it through this bus.
///
/// When the log can no longer be written, recording ends and the bus goes on: ask failure() after each handle().
class RecordingBus : public Bus {
 public:
  /// Borrows the bus, which must outlive it; a log of this name is replaced. Throws InputError when it cannot be
  /// written.
  RecordingBus(Bus& bus, const std::string& path);

  /// The same into any log.
  RecordingBus(Bus& bus, std::unique_ptr<LogSink> log);
  RecordingBus(const RecordingBus&) = delete;
  RecordingBus& operator=(const RecordingBus&) = delete;

  /// The log is complete. Call finish() to hear whether it is.
  ~RecordingBus() override { record_->log.reset(); }

  /// Records and sends. Throws as the bus does; a log that cannot be written does not keep a message from being sent.
  void publish(const std::string& channel, const std::vector<std::uint8_t>& bytes) override;
  void subscribe(const std::string& channel, Handler handler) override;
  void subscribeAll(Listener listener) override;
  void overhear(const std::string& channel, Handler handler) override { bus_.overhear(channel, std::move(handler)); }
  std::string sender() const override { return bus_.sender(); }
  int handle(std::chrono::milliseconds timeout) override { return bus_.handle(timeout); }
  bool ended() const override { return bus_.ended(); }
  std::int64_t refused() const override { return bus_.refused(); }

  /// Why recording has ended early: one line that names the file, the cause, and how many messages it holds. Nothing
  /// while all were recorded.
  const std::optional<std::string>& failure() const { return record_->log->failure(); }

  /// Ends the recording: waits until the log is on its disk, and closes it. Returns failure(). The bus goes on.
  [[nodiscard]] std::optional<std::string> finish() { return record_->log->finish(); }

 private:
  struct Record {
    std::unique_ptr<LogSink> log;    // None once this object has ended.
    std::set<std::string> channels;  // Those that have a recording handler of their own.
    bool all = false;
    void write(const std::string& channel, const std::uint8_t* data, std::size_t size) {
      if (log) log->write(channel, data, size);
    }
  };

  Bus& bus_;
  std::shared_ptr<Record> record_;  // Shared with the inner bus's handlers, which may outlive this object.
};

}  // namespace angio::messaging
