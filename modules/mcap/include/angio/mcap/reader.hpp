// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "angio/mcap/records.hpp"

namespace angio::mcap {

/// Whether a file begins as MCAP files do; no when there is none.
bool isMcap(const std::string& path);

/// A message with its channel, and where it stands.
struct PlacedMessage {
  const Channel* channel = nullptr;  ///< Valid as long as the reader is.
  Message message;
  std::int64_t position_bytes = 0;  ///< Counted in the records of all chunks, uncompressed, one after the other.
};

/// Reads an MCAP file from bytes that may come from anywhere: what its length fields say is checked against the file
/// before anything is allocated, and no more than kMaxChunk_bytes is unpacked at once. A file that is cut is read up to
/// its last whole record; a chunk whose CRC is wrong is left out.
class Reader {
 public:
  /// Throws InputError that names the file when it cannot be read, is no MCAP file, or is compressed by what is not
  /// known here: others than zstd.
  explicit Reader(const std::string& path);

  /// The next message, or nothing at the end.
  std::optional<PlacedMessage> next();

  /// The next message will be the first one at or behind this position, 0 to size_bytes().
  void seek(std::int64_t position_bytes);

  std::int64_t position_bytes() const { return position_; }
  std::int64_t size_bytes() const { return size_; }  ///< Of all chunks' records, uncompressed.

  /// How much of the file could not be read, so far [bytes].
  std::int64_t skipped_bytes() const { return skipped_; }

  /// Whether the file has its end: no for a recording that was cut.
  bool whole() const { return whole_; }

  /// Files within the file, in their order; one whose CRC is wrong is left out.
  std::vector<Attachment> attachments();

 private:
  // Records that stand together: a chunk's, or those between chunks.
  struct Block {
    std::int64_t file_bytes = 0;  // Where they stand in the file ...
    std::int64_t stored_bytes = 0;
    std::int64_t unpacked_bytes = 0;
    std::int64_t position_bytes = 0;  // ... and among all records.
    std::uint32_t crc = 0;            // 0: none.
    bool packed = false;
  };

  void scan();
  void enterChunk(std::int64_t record, std::int64_t length);
  void enterBlock(Block block);
  std::string bytesAt(std::int64_t place, std::int64_t count);
  std::size_t blockAt(std::int64_t position_bytes) const;
  bool load(std::size_t block);
  std::optional<PlacedMessage> parse(std::uint8_t opcode, std::string_view content, std::int64_t position);

  std::string path_;
  std::ifstream file_;
  std::int64_t file_size_ = 0, size_ = 0, position_ = 0, wanted_ = 0, skipped_ = 0;
  bool whole_ = false;
  std::vector<Block> blocks_;
  std::vector<bool> bad_;
  std::vector<std::pair<std::int64_t, std::int64_t>> attachments_;  // Place and length.
  std::map<std::uint16_t, Channel> channels_;
  std::optional<std::size_t> loaded_;
  std::string records_;  // Of the loaded block.
};

}  // namespace angio::mcap
