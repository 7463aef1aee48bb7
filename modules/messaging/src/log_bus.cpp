// SPDX-License-Identifier: GPL-2.0-or-later
#include "log_bus.hpp"

#include <poll.h>

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "angio/messaging/log_writer.hpp"

namespace angio::messaging {
namespace {

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
    using Count = std::chrono::milliseconds::rep;
    poll(nullptr, 0, static_cast<int>(std::clamp<Count>(timeout.count(), 0, std::numeric_limits<int>::max())));
    return 0;
  }

  bool ended() const override { return true; }
  std::int64_t refused() const override { return 0; }

 private:
  LogWriter log_;
};

}  // namespace

std::unique_ptr<Bus> openLogBus(const std::string& url) {
  const std::string behind = url.substr(url.find("://") + 3);
  return std::make_unique<LogBus>(behind.substr(0, behind.find('?')));
}

}  // namespace angio::messaging
