// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "angio/base/appended_file.hpp"
#include "angio/mcap/records.hpp"

namespace angio::mcap {

enum class Compression { kNone, kZstd };

/// How an MCAP file is laid out.
struct WriterSettings {
  Compression compression = Compression::kZstd;
  std::size_t chunk_bytes = 1 << 20;            ///< A chunk ends once its records are as long as this ...
  std::uint64_t chunk_span_ns = 1'000'000'000;  ///< ... or its messages are as far apart.
  std::string profile, library = "angio";       ///< Of the file's header.
};

/// Writes an MCAP file: messages in chunks with an index, each chunk checked by a CRC, attachments between them, and a
/// summary at the end. A chunk is appended in one piece as soon as it is full, so that a file that is cut holds whole
/// chunks. Source: the MCAP format specification, version 0, https://mcap.dev/spec.
class Writer {
 public:
  /// Begins the file, which is borrowed. All of these throw std::runtime_error with the cause when it cannot be
  /// written, and std::invalid_argument on what the format cannot hold: more than 65,535 schemas or channels, or a
  /// message as long as kMaxChunk_bytes.
  explicit Writer(AppendedFile& file, WriterSettings settings = {});
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;
  ~Writer();

  /// The number by which channels and messages name it.
  std::uint16_t add(const Schema& schema);
  std::uint16_t add(const Channel& channel);

  void write(const Message& message);
  void attach(const Attachment& attachment);

  /// Ends the chunk that is begun, and writes the summary.
  void finish();

  std::int64_t messages() const;          ///< Written so far.
  std::int64_t messagesInChunks() const;  ///< Those of chunks that are in the file.

 private:
  struct State;
  void endChunk();
  void append(const std::string& bytes);
  std::unique_ptr<State> state_;
};

}  // namespace angio::mcap
