// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "angio/messaging/disturbed_bus.hpp"

namespace angio {

/// A program's bus whose network is made bad on purpose, in real time: for trying a set-up before it is trusted.
class BadNetwork : public Bus {
 public:
  /// @param settings_path  What happens to all that this program says (.yaml, DisturbanceSettings). Borrows the bus.
  /// Throws InputError when it cannot be read.
  BadNetwork(Bus& bus, const std::string& settings_path);

  void publish(const std::string& channel, const std::vector<std::uint8_t>& bytes) override;
  void subscribe(const std::string& channel, Handler handler) override { bus_.subscribe(channel, std::move(handler)); }
  void subscribeAll(Listener listener) override { bus_.subscribeAll(std::move(listener)); }

  /// Sends what is due meanwhile, to the millisecond.
  int handle(std::chrono::milliseconds timeout) override;
  bool ended() const override { return bus_.ended(); }

 private:
  Bus& bus_;
  DisturbedBus disturbed_;
};

}  // namespace angio
