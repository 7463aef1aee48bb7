// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "angio/messaging/namespace.hpp"
#include "angio/types/any_message.hpp"

namespace angio::messaging {

/// What decoding gave: the value, or one line that says why there is none.
template <typename T>
struct [[nodiscard]] Decoded {
  std::optional<T> value;
  std::string error;  ///< Message type, field and rule; empty when there is a value.
};

/// How the pixels of an X-ray frame travel; both give back the same ones.
enum class ImageEncoding : std::int8_t { kRaw = 0, kPng = 1 };

namespace wire {

template <typename Any>
struct Alternatives;
/// The messages of a variant, counted and found at compile time.
template <typename... T>
struct Alternatives<std::variant<T...>> {
  using Pointer = std::variant<const T*...>;

  /// Place of one of the messages among them.
  template <typename One>
  static constexpr std::size_t indexOf() {
    static_assert((std::is_same_v<One, T> || ...), "not one of AnyMessage");
    std::size_t index = 0;
    for (const bool found : {std::is_same_v<One, T>...}) {
      if (found) break;
      ++index;
    }
    return index;
  }
};
using Messages = Alternatives<AnyMessage>;

std::vector<std::uint8_t> encode(const Messages::Pointer& message);
Decoded<AnyMessage> decode(std::size_t alternative, const std::uint8_t* data, std::size_t size);

}  // namespace wire

/// The bytes of a message, one of AnyMessage, as its .lcm type lays them out. Decoding them gives the same value, bit
/// for bit; the pixels of a frame travel as they are.
///
/// Throws std::invalid_argument on what must never go on the wire: a number that is not finite, a rotation that is
/// none, an image that is not CV_8UC1 or CV_16UC1 or not of its camera's size, a negative validity, variance or count,
/// a text with a NUL in it.
template <typename T>
std::vector<std::uint8_t> encode(const T& message) {
  return wire::encode(&message);
}
std::vector<std::uint8_t> encode(const XrayFrame& frame, ImageEncoding encoding);

/// Reads one message from exactly `size` bytes that may come from anywhere. Never throws on their content and never
/// reads beyond them: gives a value that encode() would accept, or the reason why not (another type's fingerprint, too
/// few or too many bytes, a size field that lies, a value that breaks its rule).
template <typename T>
Decoded<T> decode(const std::uint8_t* data, std::size_t size) {
  Decoded<AnyMessage> any = wire::decode(wire::Messages::indexOf<T>(), data, size);
  Decoded<T> decoded;
  if (any.value) decoded.value.emplace(std::get<T>(std::move(*any.value)));
  decoded.error = std::move(any.error);
  return decoded;
}

}  // namespace angio::messaging
