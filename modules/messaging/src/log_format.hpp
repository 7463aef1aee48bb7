// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "angio/messaging/namespace.hpp"

namespace angio::messaging {

// Each event of a log: this word, its number (64 bit), its time (64), lengths of channel and data (32 each), and these
// two; all numbers are big-endian (lcm's eventlog.c).
constexpr std::uint32_t kLogMagic = 0xEDA1DA01;
constexpr std::size_t kLogHeader_bytes = 28;

// A channel is shorter than this in LCM's own reader.
constexpr std::size_t kLogMaxChannel_bytes = 1000;

}  // namespace angio::messaging
