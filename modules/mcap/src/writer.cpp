// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/mcap/writer.hpp"

#include <algorithm>
#include <functional>
#include <limits>
#include <stdexcept>
#include <utility>

#include "chunk_bytes.hpp"
#include "record_bytes.hpp"

namespace angio::mcap {
namespace {

std::string bytesOf(std::uint16_t id, const Schema& schema) {
  std::string content;
  put(content, id);
  putText(content, schema.name);
  putText(content, schema.encoding);
  putText(content, schema.data);
  return content;
}

std::string bytesOf(std::uint16_t id, const Channel& channel) {
  std::string metadata;
  for (const auto& [key, value] : channel.metadata) {
    putText(metadata, key);
    putText(metadata, value);
  }
  std::string content;
  put(content, id);
  put(content, channel.schema_id);
  putText(content, channel.topic);
  putText(content, channel.message_encoding);
  putText(content, metadata);
  return content;
}

// Times of messages, from first to last; both 0 while there are none.
struct Span {
  std::uint64_t first_ns = std::numeric_limits<std::uint64_t>::max(), last_ns = 0;
  void include(std::uint64_t time_ns) {
    first_ns = std::min(first_ns, time_ns);
    last_ns = std::max(last_ns, time_ns);
  }
  void putTo(std::string& bytes) const {
    put(bytes, std::min(first_ns, last_ns));
    put(bytes, last_ns);
  }
};

struct Chunk {
  std::string records;
  Span span;
  std::int64_t messages = 0;
  // Of each channel: time of each message, and where its record begins among the chunk's.
  std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> index;
};

const char* nameOf(Compression compression) { return compression == Compression::kZstd ? "zstd" : ""; }

}  // namespace

struct Writer::State {
  AppendedFile& file;
  WriterSettings settings;
  std::uint32_t crc = 0;  // Of all that is in the file.
  Chunk chunk;
  Span span;
  std::int64_t messages_in_chunks = 0;
  std::uint16_t schema_count = 0, channel_count = 0;
  std::uint32_t chunk_count = 0, attachment_count = 0;
  std::map<std::uint16_t, std::uint64_t> counts;
  // Records of the summary, as they come about.
  std::string schemas, channels, chunk_indexes, attachment_indexes;
};

Writer::Writer(AppendedFile& file, WriterSettings settings)
    : state_(std::make_unique<State>(State{file, std::move(settings), 0, {}, {}, 0, 0, 0, 0, 0, {}, {}, {}, {}, {}})) {
  std::string header, bytes(kMagic, kMagic_bytes);
  putText(header, state_->settings.profile);
  putText(header, state_->settings.library);
  putRecord(bytes, Opcode::kHeader, header);
  append(bytes);
}

Writer::~Writer() = default;

std::int64_t Writer::messages() const { return state_->messages_in_chunks + state_->chunk.messages; }
std::int64_t Writer::messagesInChunks() const { return state_->messages_in_chunks; }

void Writer::append(const std::string& bytes) {
  if (const auto failure = state_->file.append({bytes})) throw std::runtime_error(*failure);
  state_->crc = crc32Of(bytes, state_->crc);
}

std::uint16_t Writer::add(const Schema& schema) {
  State& s = *state_;
  if (s.schema_count == std::numeric_limits<std::uint16_t>::max()) throw std::invalid_argument("too many schemas");
  const std::string content = bytesOf(++s.schema_count, schema);
  putRecord(s.schemas, Opcode::kSchema, content);
  putRecord(s.chunk.records, Opcode::kSchema, content);
  return s.schema_count;
}

std::uint16_t Writer::add(const Channel& channel) {
  State& s = *state_;
  if (s.channel_count == std::numeric_limits<std::uint16_t>::max()) throw std::invalid_argument("too many channels");
  const std::string content = bytesOf(++s.channel_count, channel);
  putRecord(s.channels, Opcode::kChannel, content);
  putRecord(s.chunk.records, Opcode::kChannel, content);
  return s.channel_count;
}

void Writer::write(const Message& message) {
  State& s = *state_;
  constexpr std::size_t kFields_bytes = 22;
  if (message.data.size() > kMaxChunk_bytes / 2) throw std::invalid_argument("a message is too long");
  if (s.chunk.records.size() + message.data.size() > kMaxChunk_bytes / 2) endChunk();
  s.chunk.index[message.channel_id].emplace_back(message.log_time_ns, s.chunk.records.size());
  putRecordHead(s.chunk.records, Opcode::kMessage, kFields_bytes + message.data.size());
  put(s.chunk.records, message.channel_id);
  put(s.chunk.records, message.sequence);
  put(s.chunk.records, message.log_time_ns);
  put(s.chunk.records, message.publish_time_ns);
  s.chunk.records += message.data;
  s.chunk.span.include(message.log_time_ns);
  ++s.chunk.messages;
  const bool full = s.chunk.records.size() >= s.settings.chunk_bytes;
  if (full || s.chunk.span.last_ns - s.chunk.span.first_ns >= s.settings.chunk_span_ns) endChunk();
}

void Writer::endChunk() {
  State& s = *state_;
  Chunk chunk = std::exchange(s.chunk, {});
  if (chunk.records.empty()) return;
  const std::string stored =
      s.settings.compression == Compression::kZstd ? packed(chunk.records) : std::string(chunk.records);
  const std::string name = nameOf(s.settings.compression);
  std::string content;
  chunk.span.putTo(content);
  put(content, std::uint64_t{chunk.records.size()});
  put(content, crc32Of(chunk.records));
  putText(content, name);
  put(content, std::uint64_t{stored.size()});

  const auto start = static_cast<std::uint64_t>(s.file.size_bytes());
  std::string bytes;
  putRecordHead(bytes, Opcode::kChunk, content.size() + stored.size());
  bytes += content + stored;
  const std::uint64_t chunk_length = bytes.size();
  std::string places;
  for (const auto& [channel, entries] : chunk.index) {
    put(places, channel);
    put(places, start + bytes.size());
    std::string listed, index;
    for (const auto& [time_ns, place] : entries) {
      put(listed, time_ns);
      put(listed, place);
    }
    put(index, channel);
    putText(index, listed);
    putRecord(bytes, Opcode::kMessageIndex, index);
  }
  std::string entry;
  chunk.span.putTo(entry);
  put(entry, start);
  put(entry, chunk_length);
  putText(entry, places);
  put(entry, std::uint64_t{bytes.size()} - chunk_length);
  putText(entry, name);
  put(entry, std::uint64_t{stored.size()});
  put(entry, std::uint64_t{chunk.records.size()});

  append(bytes);
  putRecord(s.chunk_indexes, Opcode::kChunkIndex, entry);
  ++s.chunk_count;
  s.messages_in_chunks += chunk.messages;
  for (const auto& [channel, entries] : chunk.index) s.counts[channel] += entries.size();
  if (chunk.messages == 0) return;
  s.span.include(chunk.span.first_ns);
  s.span.include(chunk.span.last_ns);
}

void Writer::attach(const Attachment& attachment) {
  State& s = *state_;
  endChunk();  // Attachments stand between chunks.
  std::string content;
  put(content, attachment.log_time_ns);
  put(content, std::uint64_t{0});  // When the file was made is not known.
  putText(content, attachment.name);
  putText(content, attachment.media_type);
  put(content, std::uint64_t{attachment.data.size()});
  content += attachment.data;
  put(content, crc32Of(content));

  std::string entry, bytes;
  putRecord(bytes, Opcode::kAttachment, content);
  put(entry, static_cast<std::uint64_t>(s.file.size_bytes()));
  put(entry, std::uint64_t{bytes.size()});
  put(entry, attachment.log_time_ns);
  put(entry, std::uint64_t{0});
  put(entry, std::uint64_t{attachment.data.size()});
  putText(entry, attachment.name);
  putText(entry, attachment.media_type);
  append(bytes);
  putRecord(s.attachment_indexes, Opcode::kAttachmentIndex, entry);
  ++s.attachment_count;
}

void Writer::finish() {
  State& s = *state_;
  endChunk();
  std::string end, content;
  put(content, s.crc);
  putRecord(end, Opcode::kDataEnd, content);
  append(end);

  std::string counts, statistics, statistics_record;
  for (const auto& [channel, count] : s.counts) {
    put(counts, channel);
    put(counts, count);
  }
  put(statistics, static_cast<std::uint64_t>(s.messages_in_chunks));
  put(statistics, s.schema_count);
  put(statistics, std::uint32_t{s.channel_count});
  put(statistics, s.attachment_count);
  put(statistics, std::uint32_t{0});  // Metadata records.
  put(statistics, s.chunk_count);
  s.span.putTo(statistics);
  putText(statistics, counts);
  putRecord(statistics_record, Opcode::kStatistics, statistics);

  const auto start = static_cast<std::uint64_t>(s.file.size_bytes());
  std::string summary, offsets;
  const auto add_group = [&](Opcode opcode, const std::string& records) {
    if (records.empty()) return;
    std::string offset;
    put(offset, static_cast<std::uint8_t>(opcode));
    put(offset, start + summary.size());
    put(offset, std::uint64_t{records.size()});
    putRecord(offsets, Opcode::kSummaryOffset, offset);
    summary += records;
  };
  add_group(Opcode::kSchema, s.schemas);
  add_group(Opcode::kChannel, s.channels);
  add_group(Opcode::kStatistics, statistics_record);
  add_group(Opcode::kChunkIndex, s.chunk_indexes);
  add_group(Opcode::kAttachmentIndex, s.attachment_indexes);
  const std::uint64_t offsets_start = start + summary.size();
  summary += offsets;
  constexpr std::uint64_t kFooter_bytes = 20;
  putRecordHead(summary, Opcode::kFooter, kFooter_bytes);
  put(summary, start);
  put(summary, offsets_start);
  put(summary, crc32Of(summary));
  summary.append(kMagic, kMagic_bytes);
  append(summary);
}

}  // namespace angio::mcap
