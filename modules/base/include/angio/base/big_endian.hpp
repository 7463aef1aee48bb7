// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "angio/base/namespace.hpp"

namespace angio::base {

/// The unsigned integer of a number's size: 1, 2, 4 or 8 bytes.
template <typename Number>
using BitsOf =
    std::conditional_t<sizeof(Number) == 8, std::uint64_t,
                       std::conditional_t<sizeof(Number) == 4, std::uint32_t,
                                          std::conditional_t<sizeof(Number) == 2, std::uint16_t, std::uint8_t>>>;

/// The integer or IEEE 754 number that the first sizeof(Number) bytes are, the highest first. @param bytes  Of char or
/// std::uint8_t.
template <typename Number, typename Byte>
Number bigEndian(const Byte* bytes) {
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < sizeof(Number); ++i) bits = bits << 8 | static_cast<std::uint8_t>(bytes[i]);
  const auto same = static_cast<BitsOf<Number>>(bits);
  Number number;
  std::memcpy(&number, &same, sizeof number);
  return number;
}

}  // namespace angio::base
