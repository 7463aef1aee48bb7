// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/base/namespace.hpp"

namespace angio::base {

/// Names in one line, "a, b, c", or with what is given `between` them; of more than `most` the first, and "...".
inline std::string joined(const std::vector<std::string>& names, std::size_t most = static_cast<std::size_t>(-1),
                          const char* between = ", ") {
  std::string line;
  for (std::size_t i = 0; i < names.size() && i < most; ++i) line += (i == 0 ? "" : between) + names[i];
  return names.size() > most ? line + between + "..." : line;
}

}  // namespace angio::base
