// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "angio/messaging/bus.hpp"

namespace angio {

/// Writes all that one party hears and says, in that order, into a log that lcm-logplayer and angio-replay read. A
/// channel counts as heard while somebody listens to it through this bus.
class RecordingBus : public Bus {
 public:
  /// Borrows the bus, which must outlive it; a log of this name is replaced. Throws InputError when it cannot be
  /// written.
  RecordingBus(Bus& bus, const std::string& path);
  RecordingBus(const RecordingBus&) = delete;
  RecordingBus& operator=(const RecordingBus&) = delete;

  /// The log is complete.
  ~RecordingBus() override { record_->log.reset(); }

  /// Records and sends. Throws std::runtime_error also when the log cannot be written (then nothing was sent): who must
  /// record does not go on without.
  void publish(const std::string& channel, const std::vector<std::uint8_t>& bytes) override;
  void subscribe(const std::string& channel, Handler handler) override;
  void subscribeAll(Listener listener) override;
  int handle(std::chrono::milliseconds timeout) override { return bus_.handle(timeout); }
  bool ended() const override { return bus_.ended(); }
  std::int64_t refused() const override { return bus_.refused(); }

 private:
  struct Record {
    std::unique_ptr<Bus> log;        // None once the recording has ended.
    std::set<std::string> channels;  // Those that have a recording handler of their own.
    bool all = false;
    void write(const std::string& channel, const std::uint8_t* data, std::size_t size);
  };

  Bus& bus_;
  std::shared_ptr<Record> record_;  // Shared with the inner bus's handlers, which may outlive this object.
};

}  // namespace angio
