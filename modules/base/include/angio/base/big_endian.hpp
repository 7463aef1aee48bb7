// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "angio/base/namespace.hpp"

namespace angio::base {

/// The integer that the first sizeof(Number) bytes are, the highest first. @param bytes  Of char or std::uint8_t.
template <typename Number, typename Byte>
Number bigEndian(const Byte* bytes) {
  std::uint64_t number = 0;
  for (std::size_t i = 0; i < sizeof(Number); ++i) number = number << 8 | static_cast<std::uint8_t>(bytes[i]);
  return static_cast<Number>(number);
}

}  // namespace angio::base
