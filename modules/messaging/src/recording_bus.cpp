// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/recording_bus.hpp"

#include <utility>

#include "angio/messaging/log_writer.hpp"

namespace angio::messaging {
RecordingBus::RecordingBus(Bus& bus, const std::string& path) : RecordingBus(bus, std::make_unique<LogWriter>(path)) {}

RecordingBus::RecordingBus(Bus& bus, std::unique_ptr<LogSink> log) : bus_(bus), record_(std::make_shared<Record>()) {
  record_->log = std::move(log);
}

void RecordingBus::publish(const std::string& channel, const std::vector<std::uint8_t>& bytes) {
  record_->write(channel, bytes.data(), bytes.size());
  bus_.publish(channel, bytes);
}

void RecordingBus::subscribe(const std::string& channel, Handler handler) {
  if (!record_->all && record_->channels.insert(channel).second) {
    bus_.subscribe(channel, [record = record_, channel](const std::uint8_t* data, std::size_t size) {
      record->write(channel, data, size);
    });
  }
  bus_.subscribe(channel, std::move(handler));
}

void RecordingBus::subscribeAll(Listener listener) {
  if (!std::exchange(record_->all, true)) {
    bus_.subscribeAll([record = record_](const std::string& channel, const std::uint8_t* data, std::size_t size) {
      if (record->channels.count(channel) == 0) record->write(channel, data, size);
    });
  }
  bus_.subscribeAll(std::move(listener));
}

}  // namespace angio::messaging
