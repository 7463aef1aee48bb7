// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "angio/mcap/namespace.hpp"

namespace angio::mcap {

/// CRC-32 of the bytes behind those whose CRC is `before`.
std::uint32_t crc32Of(std::string_view bytes, std::uint32_t before = 0);

/// The bytes as one zstd frame.
std::string packed(std::string_view bytes);

/// What was packed; nothing unless it is a zstd frame of exactly so many bytes.
std::optional<std::string> unpacked(std::string_view bytes, std::size_t size);

}  // namespace angio::mcap
