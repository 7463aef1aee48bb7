// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <chrono>
#include <cstdint>

#include "angio/base/namespace.hpp"

namespace angio::base {

/// A time of this machine's monotonic clock, as messages carry it [us].
inline std::int64_t monotonic_us(std::chrono::steady_clock::time_point time = std::chrono::steady_clock::now()) {
  return std::chrono::duration_cast<std::chrono::microseconds>(time.time_since_epoch()).count();
}

}  // namespace angio::base
