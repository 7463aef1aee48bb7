// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <limits>

namespace angio::test {

inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

}  // namespace angio::test
