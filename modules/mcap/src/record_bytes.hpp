// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "angio/mcap/records.hpp"

// Fields of records: little-endian numbers, and texts behind their lengths.
namespace angio::mcap {

enum class Opcode : std::uint8_t {
  kHeader = 1,
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kMessage = 5,
  kChunk = 6,
  kMessageIndex = 7,
  kChunkIndex = 8,
  kAttachment = 9,
  kAttachmentIndex = 10,
  kStatistics = 11,
  kSummaryOffset = 14,
  kDataEnd = 15
};

/// Of an opcode and a length, before each record's content.
constexpr std::size_t kRecordHead_bytes = 9;

template <typename Number>
void put(std::string& bytes, Number number) {
  for (std::size_t i = 0; i < sizeof number; ++i) {
    bytes += static_cast<char>(static_cast<std::uint64_t>(number) >> (8 * i) & 0xFF);
  }
}

inline void putText(std::string& bytes, std::string_view text) {
  put(bytes, static_cast<std::uint32_t>(text.size()));
  bytes += text;
}

inline void putRecordHead(std::string& bytes, Opcode opcode, std::uint64_t length) {
  put(bytes, static_cast<std::uint8_t>(opcode));
  put(bytes, length);
}

inline void putRecord(std::string& bytes, Opcode opcode, std::string_view content) {
  putRecordHead(bytes, opcode, content.size());
  bytes += content;
}

/// Takes fields from the front of bytes; broken() once more was asked for than there is.
class FieldTaker {
 public:
  explicit FieldTaker(std::string_view bytes) : left_(bytes) {}

  bool broken() const { return broken_; }
  std::string_view left() const { return left_; }

  template <typename Number>
  Number number() {
    const std::string_view bytes = take(sizeof(Number));
    std::uint64_t value = 0;
    for (std::size_t i = bytes.size(); i-- > 0;) value = value << 8 | static_cast<std::uint8_t>(bytes[i]);
    return static_cast<Number>(value);
  }
  std::string_view text() { return take(number<std::uint32_t>()); }

  std::string_view take(std::uint64_t count) {
    if (count > left_.size()) {
      broken_ = true;
      left_ = {};
      return {};
    }
    const std::string_view taken = left_.substr(0, static_cast<std::size_t>(count));
    left_.remove_prefix(taken.size());
    return taken;
  }

 private:
  std::string_view left_;
  bool broken_ = false;
};

}  // namespace angio::mcap
