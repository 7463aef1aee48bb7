// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <igtl_util.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/igtl/namespace.hpp"

namespace angio::igtl {

constexpr std::size_t kType_bytes = 12, kDevice_bytes = 20;
constexpr std::uint16_t kExtendedHead_bytes = 12;  // Of header version 2, before the content.

/// Appends a number, its highest byte first.
template <typename Number>
void putBig(std::string& bytes, Number number) {
  for (std::size_t i = sizeof number; i-- > 0;)
    bytes += static_cast<char>(static_cast<std::uint64_t>(number) >> (8 * i));
}

inline std::uint64_t crcOf(std::string_view body) {
  // The library takes bytes that it does not change as ones that it might.
  auto* bytes = reinterpret_cast<unsigned char*>(const_cast<char*>(body.data()));
  return ::crc64(bytes, body.size(), ::crc64(nullptr, 0, 0));
}

/// The same rigid transform with axes R, A, S on both sides, and millimetres; and back.
Eigen::Matrix4d rasMatrix(const Pose& T_lps);

}  // namespace angio::igtl
