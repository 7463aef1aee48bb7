// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "angio/mcap/namespace.hpp"

namespace angio::mcap {

/// How the messages of a channel are laid out.
struct Schema {
  std::string name;      ///< Of the type, "foxglove.Log".
  std::string encoding;  ///< Of `data`, "jsonschema".
  std::string data;
};

/// A stream of messages of one kind.
struct Channel {
  std::uint16_t schema_id = 0;  ///< 0: none.
  std::string topic;
  std::string message_encoding;  ///< "json"; of LCM's own bytes kLcmEncoding.
  std::map<std::string, std::string> metadata;
};

/// One message of a channel.
struct Message {
  std::uint16_t channel_id = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time_ns = 0;  ///< When it was recorded, since 1970.
  std::uint64_t publish_time_ns = 0;
  std::string data;
};

/// A file within the file.
struct Attachment {
  std::uint64_t log_time_ns = 0;
  std::string name, media_type, data;
};

/// Longest records of one chunk, uncompressed, that are written or read [bytes].
constexpr std::size_t kMaxChunk_bytes = std::size_t{1} << 28;

/// Encoding of channels whose messages are LCM's own bytes, as they were on the bus.
constexpr char kLcmEncoding[] = "lcm";

/// What each MCAP file begins with, and a whole one ends with.
constexpr char kMagic[] = "\x89MCAP0\r\n";
constexpr std::size_t kMagic_bytes = 8;

}  // namespace angio::mcap
