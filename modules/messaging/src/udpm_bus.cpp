// SPDX-License-Identifier: GPL-2.0-or-later
#include "udpm_bus.hpp"

#include <lcm/lcm.h>
#include <poll.h>

#include <exception>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "angio/base/errors.hpp"
#include "udpm_address.hpp"
#include "udpm_receiver.hpp"

namespace angio::messaging {
namespace {

class UdpmBus final : public Bus {
 public:
  explicit UdpmBus(const std::string& url) : url_(url), address_(parseUdpmUrl(url)), lcm_(nullptr, lcm_destroy) {
    requireRoute(url, address_);  // LCM would say so on stderr.
    lcm_.reset(lcm_create(lcmUrl(address_).c_str()));
    if (!lcm_) throw InputError("bus", "url", url, std::string("cannot be opened: ") + kMulticastRule);
  }

  void publish(const std::string& channel, const std::vector<std::uint8_t>& bytes) override {
    const bool sendable = !channel.empty() && channel.size() <= LcmDatagrams::kMaxChannel_bytes &&
                          channel.find('\0') == channel.npos && bytes.size() <= LcmDatagrams::kMaxMessage_bytes;
    if (!sendable || lcm_publish(lcm_.get(), channel.c_str(), bytes.data(), static_cast<unsigned>(bytes.size())) != 0) {
      throw std::runtime_error("bus " + url_ + ": cannot send " + std::to_string(bytes.size()) + " bytes on " +
                               channel);
    }
  }

  void subscribe(const std::string& channel, Handler handler) override {
    receiver(channel).want(channel);
    subscriptions_.push_back(std::make_unique<Subscription>(
        Subscription{channel, [handler = std::move(handler)](const std::string&, const std::uint8_t* data,
                                                             std::size_t size) { handler(data, size); }}));
  }

  void overhear(const std::string& channel, Handler handler) override {
    const std::string self = receiver(channel).self().text();
    subscribe(channel, [this, self, handler = std::move(handler)](const std::uint8_t* data, std::size_t size) {
      if (sender_ != self) handler(data, size);
    });
  }

  std::string sender() const override { return sender_; }

  void subscribeAll(Listener listener) override {
    receiver("all channels").wantAll();
    subscriptions_.push_back(std::make_unique<Subscription>(Subscription{std::nullopt, std::move(listener)}));
  }

  int handle(std::chrono::milliseconds timeout) override {
    if (handling_) throw std::logic_error("Bus::handle() was called from within a handler");
    int wait_ms = waitOf(timeout);
    if (!receiver_) {  // Nothing can come.
      poll(nullptr, 0, wait_ms);
      return 0;
    }
    for (int handled = 0; handled < kMaxDrain; ++handled, wait_ms = 0) {
      const auto message = receiver_->next(wait_ms);
      if (!message) return handled;
      handOut(*message);
    }
    return kMaxDrain;
  }

  bool ended() const override { return false; }

  std::int64_t refused() const override { return receiver_ ? receiver_->refused() : 0; }

 private:
  struct Subscription {
    std::optional<std::string> channel;  // None: all.
    Listener listener;
  };

  static std::string lcmUrl(const UdpmAddress& address) {
    return "udpm://" + address.groupAndPort() + "?ttl=" + std::to_string(address.ttl);
  }

  // Begins to listen with the first subscription.
  UdpmReceiver& receiver(const std::string& channels) {
    if (receiver_) return *receiver_;
    try {
      receiver_ = std::make_unique<UdpmReceiver>(address_, [this](const std::string& text) {
        lcm_publish(lcm_.get(), kLcmSelfTestChannel, text.data(), static_cast<unsigned>(text.size()));
      });
    } catch (const std::exception& error) {
      throw InputError("bus", "url", url_,
                       "cannot receive on " + channels + " (" + error.what() + "): " + kMulticastRule);
    }
    return *receiver_;
  }

  void handOut(const LcmMessage& message) {
    std::exception_ptr thrown;
    handling_ = true;
    sender_ = message.sender.text();
    // Handlers may subscribe: only those that were there hear this message.
    for (std::size_t i = 0, count = subscriptions_.size(); i < count; ++i) {
      const Subscription& subscription = *subscriptions_[i];
      if (subscription.channel && *subscription.channel != message.channel) continue;
      try {
        subscription.listener(message.channel, message.bytes.data(), message.bytes.size());
      } catch (...) {
        if (!thrown) thrown = std::current_exception();
      }
    }
    handling_ = false;
    sender_.clear();
    if (thrown) std::rethrow_exception(thrown);
  }

  std::string url_;
  UdpmAddress address_;
  std::unique_ptr<lcm_t, void (*)(lcm_t*)> lcm_;
  std::vector<std::unique_ptr<Subscription>> subscriptions_;
  std::unique_ptr<UdpmReceiver> receiver_;
  bool handling_ = false;
  std::string sender_;  // Of the message that is being handled.
};

}  // namespace

std::unique_ptr<Bus> openUdpmBus(const std::string& url) { return std::make_unique<UdpmBus>(url); }

}  // namespace angio::messaging
