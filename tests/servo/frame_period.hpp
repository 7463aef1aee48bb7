// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>

namespace angio::test {

inline constexpr std::int64_t kPeriod_us = 66'667;  ///< Of frames at 15 Hz.

}  // namespace angio::test
