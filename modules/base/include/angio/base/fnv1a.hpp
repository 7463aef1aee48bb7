// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "angio/base/namespace.hpp"

namespace angio::base {

/// FNV-1a, 64 bits: the same on every machine, unlike std::hash. Tells mix-ups apart, not forgeries.
/// Source: Fowler, Noll, Vo, Eastlake, The FNV Non-Cryptographic Hash Algorithm, IETF draft.
class Fnv1a {
 public:
  void addByte(std::uint8_t byte) { hash_ = (hash_ ^ byte) * 0x100000001b3ULL; }

  /// Bytes as they lie in memory.
  void add(const void* data, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i) addByte(static_cast<const std::uint8_t*>(data)[i]);
  }

  /// A number, lowest byte first.
  void add(std::int64_t number) {
    for (int byte = 0; byte < 8; ++byte)
      addByte(static_cast<std::uint8_t>(static_cast<std::uint64_t>(number) >> 8 * byte));
  }

  std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325ULL;
};

}  // namespace angio::base
