// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <limits>
#include <memory>
#include <string>

#include "angio/messaging/bus.hpp"

namespace angio::messaging {

/// Messages that one call of Bus::handle() hands out at most.
constexpr int kMaxDrain = 1000;

/// A timeout as poll() takes it [ms].
inline int waitOf(std::chrono::milliseconds timeout) {
  using Count = std::chrono::milliseconds::rep;
  return static_cast<int>(std::clamp<Count>(timeout.count(), 0, std::numeric_limits<int>::max()));
}

/// Opens a bus on UDP multicast, "udpm://group:port?ttl=0". It publishes by LCM and receives by itself, because LCM
/// 1.3.1 takes the lengths in a datagram on its sender's word, and one wrong datagram ends its program. Throws as
/// openBus() does.
std::unique_ptr<Bus> openUdpmBus(const std::string& url);

}  // namespace angio::messaging
