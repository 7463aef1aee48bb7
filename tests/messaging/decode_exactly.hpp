// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <gmock/gmock.h>

#include <algorithm>
#include <memory>

#include "angio/messaging/codec.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {

/// Decodes from memory of exactly this size, so that a sanitizer sees the first byte read beyond it. Whatever is
/// decoded could have been encoded.
template <typename T>
Decoded<T> decodeExactly(const std::vector<std::uint8_t>& bytes) {
  const std::unique_ptr<std::uint8_t[]> copy(new std::uint8_t[bytes.size()]);
  std::copy(bytes.begin(), bytes.end(), copy.get());
  Decoded<T> decoded = decode<T>(copy.get(), bytes.size());
  EXPECT_NE(decoded.value.has_value(), !decoded.error.empty());
  EXPECT_THAT(decoded.error, testing::Not(testing::HasSubstr("\n")));
  if (decoded.value) {
    EXPECT_NO_THROW(encode(*decoded.value));
  }
  return decoded;
}

template <typename T>
void expectRefused(const std::vector<std::uint8_t>& bytes) {
  EXPECT_FALSE(decodeExactly<T>(bytes).value.has_value());
}

}  // namespace angio::test
