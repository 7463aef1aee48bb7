// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "angio/types/namespace.hpp"

namespace angio::types {

/// A message's time, and whose it is.
struct TimeStamp {
  std::string channel;
  std::string sender;  ///< As the bus names it; empty: unknown.
  std::int64_t time_us = 0;
};

/// "XRAY_FRAME from 10.0.0.1:4000", or the channel alone.
std::string sourceOf(const TimeStamp& stamp);

/// The time for people: "1763938257000000 us (since 1970)", "81234500000 us (22.6 h)".
std::string timeInWords(std::int64_t time_us);

/// Whether two times lie so far apart, more than 1 h, that no delay explains it: their clocks count from different
/// epochs.
bool differentEpochs(std::int64_t a_us, std::int64_t b_us);

/// Says that two messages' clocks count from different epochs, with both times and what to do; nothing when they count
/// from one.
std::optional<std::string> differentEpochs(const TimeStamp& a, const TimeStamp& b);

}  // namespace angio::types
