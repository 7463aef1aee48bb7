// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/mcap/reader.hpp"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include "angio/base/errors.hpp"
#include "chunk_bytes.hpp"
#include "record_bytes.hpp"

namespace angio::mcap {
namespace {

// Longest schema, channel or attachment that is read at once [bytes].
constexpr std::int64_t kMaxRecord_bytes = std::int64_t{1} << 30;

std::optional<std::pair<std::uint16_t, Channel>> channelOf(std::string_view content) {
  FieldTaker fields(content);
  const auto id = fields.number<std::uint16_t>();
  Channel channel;
  channel.schema_id = fields.number<std::uint16_t>();
  channel.topic = fields.text();
  channel.message_encoding = fields.text();
  FieldTaker metadata(fields.text());
  while (!metadata.left().empty() && !metadata.broken()) {
    std::string key(metadata.text());
    channel.metadata.emplace(std::move(key), metadata.text());
  }
  if (fields.broken() || metadata.broken()) return std::nullopt;
  return std::make_pair(id, std::move(channel));
}

}  // namespace

bool isMcap(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string first(kMagic_bytes, '\0');
  return file.read(first.data(), kMagic_bytes) && first.compare(0, kMagic_bytes, kMagic, kMagic_bytes) == 0;
}

Reader::Reader(const std::string& path) : path_(path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) throw InputError(path, "", "", "is not a regular file");
  file_size_ = static_cast<std::int64_t>(std::filesystem::file_size(path, error));
  file_.open(path, std::ios::binary);
  if (error || !file_) throw InputError(path, "", "", "cannot be read");
  if (!isMcap(path)) throw InputError(path, "", "", "does not begin as an MCAP file does");
  scan();
  bad_.resize(blocks_.size());
}

std::string Reader::bytesAt(std::int64_t place, std::int64_t count) {
  std::string bytes(static_cast<std::size_t>(count), '\0');
  file_.clear();
  file_.seekg(place);
  file_.read(bytes.data(), count);
  bytes.resize(static_cast<std::size_t>(std::max<std::streamsize>(file_.gcount(), 0)));
  return bytes;
}

void Reader::enterBlock(Block block) {
  if (block.unpacked_bytes == 0) return;
  block.position_bytes = size_;
  size_ += block.unpacked_bytes;
  blocks_.push_back(block);
}

// The head of a chunk, and where its records are.
void Reader::enterChunk(std::int64_t record, std::int64_t length) {
  constexpr std::int64_t kLongestHead_bytes = 256;
  const std::string head = bytesAt(record, std::min(length, kLongestHead_bytes));
  FieldTaker fields(head);
  fields.take(16);  // Its times.
  Block block;
  const auto unpacked_bytes = fields.number<std::uint64_t>();
  block.crc = fields.number<std::uint32_t>();
  const std::string compression(fields.text());
  const auto stored_bytes = fields.number<std::uint64_t>();
  const auto behind = length - static_cast<std::int64_t>(head.size() - fields.left().size());
  block.file_bytes = record + length - behind;
  block.packed = compression == "zstd";
  if (!fields.broken() && !block.packed && !compression.empty()) {
    throw InputError(path_, "compression", compression, "must be zstd or none");
  }
  const bool sound = !fields.broken() && behind >= 0 && stored_bytes == static_cast<std::uint64_t>(behind) &&
                     unpacked_bytes <= kMaxChunk_bytes && (block.packed || unpacked_bytes == stored_bytes);
  if (!sound) {
    skipped_ += length;
    return;
  }
  block.stored_bytes = behind;
  block.unpacked_bytes = static_cast<std::int64_t>(unpacked_bytes);
  enterBlock(block);
}

void Reader::scan() {
  std::int64_t place = kMagic_bytes;
  bool in_summary = false;
  Block loose;  // Records that stand between chunks.
  const auto end_loose = [&] {
    if (loose.stored_bytes > 0) enterBlock(loose);
    loose = {};
  };
  while (file_size_ - place >= static_cast<std::int64_t>(kRecordHead_bytes)) {
    const std::string head = bytesAt(place, kRecordHead_bytes);
    FieldTaker fields(head);
    const auto opcode = static_cast<Opcode>(fields.number<std::uint8_t>());
    const auto length = fields.number<std::uint64_t>();
    const std::int64_t content = place + static_cast<std::int64_t>(kRecordHead_bytes);
    if (fields.broken() || length > static_cast<std::uint64_t>(file_size_ - content)) break;
    const auto count = static_cast<std::int64_t>(length);
    const std::int64_t next = content + count;
    const bool is_record = opcode == Opcode::kSchema || opcode == Opcode::kChannel || opcode == Opcode::kMessage;
    if (opcode == Opcode::kDataEnd) in_summary = true;
    if (in_summary && opcode == Opcode::kChannel && count < kMaxRecord_bytes) {
      const auto channel = channelOf(bytesAt(content, count));
      if (channel) channels_.insert(*channel);
    }
    const bool joins = loose.stored_bytes + next - place <= static_cast<std::int64_t>(kMaxChunk_bytes);
    if (!is_record || in_summary || !joins) end_loose();
    if (is_record && !in_summary) {
      if (loose.stored_bytes == 0) loose.file_bytes = place;
      loose.stored_bytes = loose.unpacked_bytes = loose.stored_bytes + next - place;
      if (loose.stored_bytes > static_cast<std::int64_t>(kMaxChunk_bytes)) {
        skipped_ += loose.stored_bytes;
        loose = {};
      }
    } else if (opcode == Opcode::kChunk && !in_summary) {
      enterChunk(content, count);
    } else if (opcode == Opcode::kAttachment) {
      attachments_.emplace_back(content, count);
    } else if (opcode == Opcode::kFooter) {
      whole_ = bytesAt(next, kMagic_bytes + 1) == std::string(kMagic, kMagic_bytes);
      if (whole_) place = file_size_;
      break;
    }
    place = next;
  }
  end_loose();
  skipped_ += file_size_ - place;
}

// The last one that begins there or before: behind blocks without records.
std::size_t Reader::blockAt(std::int64_t position_bytes) const {
  const auto behind = std::upper_bound(blocks_.begin(), blocks_.end(), position_bytes,
                                       [](std::int64_t p, const Block& block) { return p < block.position_bytes; });
  return static_cast<std::size_t>(behind - blocks_.begin() - 1);
}

bool Reader::load(std::size_t index) {
  if (loaded_ == index) return true;
  const Block& block = blocks_[index];
  std::string stored = bytesAt(block.file_bytes, block.stored_bytes);
  std::optional<std::string> records;
  if (static_cast<std::int64_t>(stored.size()) == block.stored_bytes) {
    records = block.packed ? unpacked(stored, static_cast<std::size_t>(block.unpacked_bytes))
                           : std::optional(std::move(stored));
  }
  if (records && block.crc != 0 && crc32Of(*records) != block.crc) records.reset();
  if (!records) {
    if (!bad_[index]) skipped_ += block.stored_bytes;
    bad_[index] = true;
    return false;
  }
  records_ = std::move(*records);
  loaded_ = index;
  return true;
}

std::optional<PlacedMessage> Reader::parse(std::uint8_t opcode, std::string_view content, std::int64_t position) {
  if (static_cast<Opcode>(opcode) == Opcode::kChannel) {
    if (auto channel = channelOf(content)) channels_.insert(std::move(*channel));
  }
  if (static_cast<Opcode>(opcode) != Opcode::kMessage) return std::nullopt;
  FieldTaker fields(content);
  PlacedMessage placed;
  placed.message.channel_id = fields.number<std::uint16_t>();
  placed.message.sequence = fields.number<std::uint32_t>();
  placed.message.log_time_ns = fields.number<std::uint64_t>();
  placed.message.publish_time_ns = fields.number<std::uint64_t>();
  if (fields.broken()) return std::nullopt;
  placed.message.data = fields.left();
  placed.position_bytes = position;
  const auto channel = channels_.find(placed.message.channel_id);
  if (channel == channels_.end()) return std::nullopt;
  placed.channel = &channel->second;
  return placed;
}

std::optional<PlacedMessage> Reader::next() {
  while (position_ < size_) {
    const std::size_t index = blockAt(position_);
    const Block& block = blocks_[index];
    const std::int64_t end = block.position_bytes + block.unpacked_bytes;
    if (!load(index)) {
      position_ = end;
      continue;
    }
    FieldTaker records(std::string_view(records_).substr(static_cast<std::size_t>(position_ - block.position_bytes)));
    const auto opcode = records.number<std::uint8_t>();
    const std::string_view content = records.take(records.number<std::uint64_t>());
    if (records.broken()) {
      skipped_ += end - position_;
      position_ = end;
      continue;
    }
    const std::int64_t place = position_;
    position_ = end - static_cast<std::int64_t>(records.left().size());
    auto message = parse(opcode, content, place);
    if (message && place >= wanted_) return message;
  }
  return std::nullopt;
}

// Where a record begins is known of a block's first one only.
void Reader::seek(std::int64_t position_bytes) {
  wanted_ = position_ = std::clamp<std::int64_t>(position_bytes, 0, size_);
  if (position_ < size_) position_ = blocks_[blockAt(position_)].position_bytes;
}

std::vector<Attachment> Reader::attachments() {
  std::vector<Attachment> read;
  for (const auto& [place, length] : attachments_) {
    if (length > kMaxRecord_bytes) continue;
    const std::string content = bytesAt(place, length);
    FieldTaker fields(content);
    Attachment one;
    one.log_time_ns = fields.number<std::uint64_t>();
    fields.number<std::uint64_t>();
    one.name = fields.text();
    one.media_type = fields.text();
    one.data = fields.take(fields.number<std::uint64_t>());
    const std::size_t checked = content.size() - fields.left().size();
    const auto crc = fields.number<std::uint32_t>();
    if (fields.broken() || (crc != 0 && crc != crc32Of(std::string_view(content).substr(0, checked)))) continue;
    read.push_back(std::move(one));
  }
  return read;
}

}  // namespace angio::mcap
