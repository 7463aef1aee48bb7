// SPDX-License-Identifier: GPL-2.0-or-later
#include "disturbance.hpp"

#include <algorithm>

#include "angio/io/settings_files.hpp"

namespace angio {
namespace {

using Clock = std::chrono::steady_clock;

std::int64_t now_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(Clock::now().time_since_epoch()).count();
}

}  // namespace

BadNetwork::BadNetwork(Bus& bus, const std::string& settings_path)
    : bus_(bus), disturbed_(bus, readSettings(settings_path, DisturbanceSettings()), 1) {
  disturbed_.advance(now_us());
}

void BadNetwork::publish(const std::string& channel, const std::vector<std::uint8_t>& bytes) {
  disturbed_.advance(now_us());
  disturbed_.publish(channel, bytes);
}

int BadNetwork::handle(std::chrono::milliseconds timeout) {
  const auto end = Clock::now() + timeout;
  for (;;) {
    disturbed_.advance(now_us());
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now());
    const std::chrono::milliseconds most(disturbed_.nextDue_us() ? 1 : 1000);
    const int handled = bus_.handle(std::clamp(left, std::chrono::milliseconds(0), most));
    if (handled > 0 || Clock::now() >= end || bus_.ended()) return handled;
  }
}

}  // namespace angio
