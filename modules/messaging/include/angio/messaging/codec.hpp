// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "angio/messaging/messages.hpp"

namespace angio {

/// What decoding gave: the value, or one line that says why there is none.
template <typename T>
struct [[nodiscard]] Decoded {
  std::optional<T> value;
  std::string error;  ///< Message type, field and rule; empty when there is a value.
};

/// How the pixels of an X-ray frame travel; both give back the same ones.
enum class ImageEncoding : std::int8_t { kRaw = 0, kPng = 1 };

/// The bytes of a message as its .lcm type lays them out. Decoding them gives the same value, bit for bit.
///
/// Throws std::invalid_argument on what must never go on the wire: a number that is not finite, a rotation that is
/// none, an image that is not CV_8UC1 or CV_16UC1 or not of its camera's size, a negative validity, variance or count,
/// a text with a NUL in it.
std::vector<std::uint8_t> encode(const XrayFrame& frame, ImageEncoding encoding = ImageEncoding::kRaw);
std::vector<std::uint8_t> encode(const CArmState& state);
std::vector<std::uint8_t> encode(const ServoInput& input);
std::vector<std::uint8_t> encode(const CArmCommand& command);
std::vector<std::uint8_t> encode(const RegistrationMessage& registration);
std::vector<std::uint8_t> encode(const ServoStatus& status);
std::vector<std::uint8_t> encode(const ServoRequest& request);
std::vector<std::uint8_t> encode(const CatheterState& state);
std::vector<std::uint8_t> encode(const CatheterCommand& command);
std::vector<std::uint8_t> encode(const CatheterTip& tip);
std::vector<std::uint8_t> encode(const CatheterInput& input);

/// Reads one message from exactly `size` bytes that may come from anywhere. Never throws on their content and never
/// reads beyond them: gives a value that encode() would accept, or the reason why not (another type's fingerprint, too
/// few or too many bytes, a size field that lies, a value that breaks its rule).
template <typename T>
Decoded<T> decode(const std::uint8_t* data, std::size_t size) = delete;
template <>
Decoded<XrayFrame> decode(const std::uint8_t* data, std::size_t size);
template <>
Decoded<CArmState> decode(const std::uint8_t* data, std::size_t size);
template <>
Decoded<ServoInput> decode(const std::uint8_t* data, std::size_t size);
template <>
Decoded<CArmCommand> decode(const std::uint8_t* data, std::size_t size);
template <>
Decoded<RegistrationMessage> decode(const std::uint8_t* data, std::size_t size);
template <>
Decoded<ServoStatus> decode(const std::uint8_t* data, std::size_t size);
template <>
Decoded<ServoRequest> decode(const std::uint8_t* data, std::size_t size);
template <>
Decoded<CatheterState> decode(const std::uint8_t* data, std::size_t size);
template <>
Decoded<CatheterCommand> decode(const std::uint8_t* data, std::size_t size);
template <>
Decoded<CatheterTip> decode(const std::uint8_t* data, std::size_t size);
template <>
Decoded<CatheterInput> decode(const std::uint8_t* data, std::size_t size);

}  // namespace angio
