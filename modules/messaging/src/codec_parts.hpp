// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <lcm/lcm_coretypes.h>

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/messaging/codec.hpp"
#include "rules.hpp"

// What all codecs share between a value and its bytes.
namespace angio::codec {

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using RowMajor6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

template <typename Wire, typename T>
void requireSound(const T& value) {
  if (const auto broken = rules::broken(value)) {
    throw std::invalid_argument(std::string(Wire::getTypeName()) + ": " + *broken);
  }
}

template <typename Wire>
std::vector<std::uint8_t> bytesOf(const Wire& wire) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(wire.getEncodedSize()));
  if (wire.encode(bytes.data(), 0, static_cast<int>(bytes.size())) != static_cast<int>(bytes.size())) {
    throw std::invalid_argument(std::string(Wire::getTypeName()) + ": cannot be encoded");
  }
  return bytes;
}

inline std::int32_t readInt32(const std::uint8_t* data) {
  std::int32_t value = 0;
  __int32_t_decode_array(data, 0, 4, &value, 1);
  return value;
}

// How a type's variable part, which stands last, says its length: LCM's own decoder believes a length field and
// allocates or reads by it, so the length is checked against the bytes that are there before the decoder sees them.
enum class Tail { kNone, kBytes, kText };

// The rule that the bytes break, or null.
template <typename Wire>
const char* brokenLayout(Tail tail, const std::uint8_t* data, std::size_t size) {
  const auto smallest = static_cast<std::size_t>(Wire{}.getEncodedSize());
  std::int64_t fingerprint = 0;
  if (size < 8) return "too short for a fingerprint";
  __int64_t_decode_array(data, 0, 8, &fingerprint, 1);
  if (fingerprint != Wire::getHash()) return "another type's fingerprint";
  if (size < smallest) return "truncated";
  if (size > static_cast<std::size_t>(rules::kLongestMessage)) return "too long";
  const auto extra = static_cast<std::int64_t>(size - smallest);
  switch (tail) {
    case Tail::kNone:
      return extra == 0 ? nullptr : "bytes behind its end";
    case Tail::kBytes:
      return readInt32(data + smallest - 4) == extra ? nullptr : "its size field is not the number of its bytes";
    case Tail::kText:
      // A text's length counts its closing NUL, which the smallest message has as well.
      if (readInt32(data + smallest - 5) != extra + 1) return "its text length is not the number of its bytes";
      return data[size - 1] == 0 ? nullptr : "its text does not end in NUL";
  }
  return "unknown layout";
}

// Bytes to value: layout, LCM's decoder, conversion, rules. `toValue` gives the value, or throws InputError.
template <typename T, typename Wire, typename Convert>
Decoded<T> decodeAs(Tail tail, const std::uint8_t* data, std::size_t size, Convert toValue) {
  Decoded<T> result;
  const std::string name = std::string(Wire::getTypeName()) + ": ";
  if (const char* broken = brokenLayout<Wire>(tail, data, size)) {
    result.error = name + broken;
    return result;
  }
  Wire wire{};
  if (wire.decode(data, 0, static_cast<int>(size)) != static_cast<int>(size)) {
    result.error = name + "cannot be decoded";
    return result;
  }
  try {
    result.value.emplace(toValue(wire));
  } catch (const InputError& wrong) {
    result.error = name + wrong.what();
    return result;
  }
  if (const auto broken = rules::broken(*result.value)) {
    result.value.reset();
    result.error = name + *broken;
  }
  return result;
}

}  // namespace angio::codec
