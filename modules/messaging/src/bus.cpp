// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/bus.hpp"

#include <lcm/lcm.h>
#include <poll.h>

#include <cctype>
#include <cerrno>
#include <exception>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <utility>

#include "angio/base/errors.hpp"
#include "angio/messaging/lcm_datagrams.hpp"
#include "angio/messaging/log_writer.hpp"
#include "udpm_address.hpp"
#include "udpm_bus.hpp"

namespace angio::messaging {
namespace {

// Messages that wait for the next handle(), on one channel (LCM's own number) and on all together; more are dropped.
constexpr int kMaxWaiting = 30, kMaxWaitingOfAll = 100;

bool startsWith(const std::string& text, const std::string& start) { return text.compare(0, start.size(), start) == 0; }

// LCM reads a channel as a regular expression; ours are names.
std::string literal(const std::string& channel) {
  std::string pattern;
  for (const char c : channel) {
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '_') pattern += '\\';
    pattern += c;
  }
  return pattern;
}

// What stands between the scheme and the options.
std::string placeOf(const std::string& url) {
  const std::size_t scheme_end = url.find("://");
  const std::string behind = scheme_end == url.npos ? "" : url.substr(scheme_end + 3);
  return behind.substr(0, behind.find('?'));
}

std::string ruleFor(const std::string& url) {
  if (startsWith(url, "file://"))
    return "cannot be opened: must be a readable log, or with ?mode=w a place to write one";
  return "cannot be opened";
}

// What LCM would refuse with a line of its own on stderr is refused here first.
void requireOpenable(const std::string& url) {
  const std::string place = placeOf(url);
  if (startsWith(url, "file://")) {
    const bool writes = url.find("mode=w") != std::string::npos;
    const std::filesystem::path path(place), folder = path.has_parent_path() ? path.parent_path() : ".";
    std::error_code ignored;
    if (!std::filesystem::exists(writes ? folder : path, ignored)) throw InputError("bus", "url", url, ruleFor(url));
    if (path.extension() == ".mcap") {
      throw InputError("bus", "url", url, "is MCAP, no log of LCM's: angio-replay --to-lcm makes one of it");
    }
  } else if (url != "memq://") {
    throw InputError("bus", "url", url, "must be memq://, udpm://group:port or file://path");
  }
}

// Inside this process, or a log.
class LcmBus final : public Bus {
 public:
  explicit LcmBus(const std::string& url) : url_(url), lcm_(lcm_create(url.c_str()), lcm_destroy) {
    if (!lcm_) throw InputError("bus", "url", url, ruleFor(url));
  }

  void publish(const std::string& channel, const std::vector<std::uint8_t>& bytes) override {
    if (bytes.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()) ||
        lcm_publish(lcm_.get(), channel.c_str(), bytes.data(), static_cast<unsigned>(bytes.size())) != 0) {
      throw std::runtime_error("bus " + url_ + ": cannot send " + std::to_string(bytes.size()) + " bytes on " +
                               channel);
    }
  }

  void subscribe(const std::string& channel, Handler handler) override {
    listen(channel, literal(channel), kMaxWaiting,
           [handler = std::move(handler)](const std::string&, const std::uint8_t* data, std::size_t size) {
             handler(data, size);
           });
  }

  void subscribeAll(Listener listener) override {
    listen("all channels", ".*", kMaxWaitingOfAll,
           [listener = std::move(listener)](const std::string& channel, const std::uint8_t* data, std::size_t size) {
             if (channel != kLcmSelfTestChannel) listener(channel, data, size);
           });
  }

  int handle(std::chrono::milliseconds timeout) override {
    if (handling_) throw std::logic_error("Bus::handle() was called from within a handler");
    int wait_ms = waitOf(timeout);
    const int most = startsWith(url_, "file://") ? 1 : kMaxDrain;
    int handled = 0;
    while (handled < most && handleOne(wait_ms)) {
      ++handled;
      wait_ms = 0;
    }
    return handled;
  }

  bool ended() const override { return ended_; }

  std::int64_t refused() const override { return 0; }

 private:
  struct Subscription {
    LcmBus* bus;
    Listener listener;
  };

  void listen(const std::string& channels, const std::string& pattern, int max_waiting, Listener listener) {
    subscriptions_.push_back(std::make_unique<Subscription>(Subscription{this, std::move(listener)}));
    lcm_subscription_t* made =
        lcm_subscribe(lcm_.get(), pattern.c_str(), &LcmBus::onMessage, subscriptions_.back().get());
    if (!made) {
      subscriptions_.pop_back();
      throw InputError("bus", "url", url_, "cannot receive on " + channels);
    }
    lcm_subscription_set_queue_capacity(made, max_waiting);
  }

  bool handleOne(int wait_ms) {
    if (ended_) return false;
    errno = 0;
    handling_ = true;
    const int result = lcm_handle_timeout(lcm_.get(), wait_ms);
    handling_ = false;
    if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
    if (result >= 0) return result > 0;
    if (errno == EINTR) return false;
    if (!startsWith(url_, "file://")) throw std::runtime_error("bus " + url_ + ": receiving failed");
    ended_ = true;  // LCM's only sign of a log's end.
    return false;
  }

  static void onMessage(const lcm_recv_buf_t* received, const char* channel, void* user) {
    auto& subscription = *static_cast<Subscription*>(user);
    try {  // LCM is C: an exception through it would end the process.
      subscription.listener(channel, static_cast<const std::uint8_t*>(received->data), received->data_size);
    } catch (...) {
      if (!subscription.bus->thrown_) subscription.bus->thrown_ = std::current_exception();
    }
  }

  std::string url_;
  std::vector<std::unique_ptr<Subscription>> subscriptions_;
  std::exception_ptr thrown_;
  bool handling_ = false;
  bool ended_ = false;
  std::unique_ptr<lcm_t, void (*)(lcm_t*)> lcm_;
};

// "file://name.lcm?mode=w": records what is published. publish() throws std::runtime_error from the message on that
// could not be written.
class LogBus final : public Bus {
 public:
  explicit LogBus(const std::string& path) : log_(path) {}

  void publish(const std::string& channel, const std::vector<std::uint8_t>& bytes) override {
    log_.write(channel, bytes.data(), bytes.size());
    if (log_.failure()) throw std::runtime_error(*log_.failure());
  }

  void subscribe(const std::string&, Handler) override {}
  void subscribeAll(Listener) override {}

  // Nothing comes: a program that waits for messages goes on at its pace.
  int handle(std::chrono::milliseconds timeout) override {
    poll(nullptr, 0, waitOf(timeout));
    return 0;
  }

  bool ended() const override { return true; }
  std::int64_t refused() const override { return 0; }

 private:
  LogWriter log_;
};

}  // namespace

std::optional<std::string> receiveBufferWarning(const std::string& url) {
  if (!startsWith(url, "udpm://")) return std::nullopt;
  std::ifstream file("/proc/sys/net/core/rmem_max");
  long allowed = 0;
  if (!(file >> allowed) || allowed >= kReceiveBuffer_bytes) return std::nullopt;
  return "receive buffers are limited to " + std::to_string(allowed) +
         " bytes, so frames of 1024 x 1024 pixels may be lost: sysctl -w net.core.rmem_max=" +
         std::to_string(kReceiveBuffer_bytes);
}

std::unique_ptr<Bus> openBus(const std::string& url) {
  if (startsWith(url, "udpm://")) return openUdpmBus(url);
  requireOpenable(url);
  if (startsWith(url, "file://") && url.find("mode=w") != url.npos) {
    return std::make_unique<LogBus>(placeOf(url));
  }
  return std::make_unique<LcmBus>(url);
}

std::unique_ptr<Bus> openSharedBus(const std::string& url) {
  if (url == "memq://") throw InputError("bus", "url", url, "is private to one program: nobody is heard there");
  return openBus(url);
}

}  // namespace angio::messaging
