// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "angio/messaging/bus.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {

/// A bus inside this process whose messages have senders: what is published through it is the owner's own, what is said
/// by another() is that one's.
class NamedBus : public messaging::Bus {
 public:
  void publish(const std::string& channel, const std::vector<std::uint8_t>& bytes) override {
    said_.push_back({"127.0.0.1:1", channel, bytes});
  }
  void another(const std::string& sender, const std::string& channel, std::vector<std::uint8_t> bytes) {
    said_.push_back({sender, channel, std::move(bytes)});
  }
  void subscribe(const std::string& channel, Handler handler) override { bus_->subscribe(channel, std::move(handler)); }
  void subscribeAll(Listener listener) override { bus_->subscribeAll(std::move(listener)); }
  void overhear(const std::string& channel, Handler handler) override {
    subscribe(channel, [this, handler = std::move(handler)](const std::uint8_t* data, std::size_t size) {
      if (sender_ != "127.0.0.1:1") handler(data, size);
    });
  }
  std::string sender() const override { return sender_; }
  int handle(std::chrono::milliseconds timeout) override {
    int handled = 0;
    for (const Said& message : std::exchange(said_, {})) {
      sender_ = message.sender;
      bus_->publish(message.channel, message.bytes);
      handled += bus_->handle(timeout);
    }
    sender_.clear();
    return handled;
  }
  bool ended() const override { return false; }
  std::int64_t refused() const override { return 0; }

 private:
  struct Said {
    std::string sender, channel;
    std::vector<std::uint8_t> bytes;
  };
  std::unique_ptr<messaging::Bus> bus_ = messaging::openBus("memq://");
  std::vector<Said> said_;
  std::string sender_;
};

}  // namespace angio::test
