// SPDX-License-Identifier: GPL-2.0-or-later
#include <array>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <limits>
#include <string_view>
#include <system_error>

#include "angio/base/big_endian.hpp"
#include "angio/base/errors.hpp"
#include "angio/mcap/reader.hpp"
#include "angio/messaging/log_reader.hpp"
#include "angio/messaging/log_writer.hpp"

namespace angio::messaging {
namespace {

// Each event of a log: this word, its number (64 bit), its time (64), lengths of channel and data (32 each), and these
// two; all numbers are big-endian (lcm's eventlog.c).
constexpr std::uint32_t kLogMagic = 0xEDA1DA01;
constexpr std::size_t kLogHeader_bytes = 28;

// A channel is shorter than this in LCM's own reader.
constexpr std::size_t kLogMaxChannel_bytes = 1000;

void appendBigEndian(std::string& text, std::uint64_t number, int bytes) {
  while (bytes-- > 0) text += static_cast<char>(number >> (8 * bytes) & 0xFF);
}

}  // namespace

LogReader::LogReader(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw InputError(path, "", "", "does not exist");
  if (!std::filesystem::is_regular_file(path, error)) throw InputError(path, "", "", "is not a regular file");
  size_ = static_cast<std::int64_t>(std::filesystem::file_size(path, error));
  file_.open(path, std::ios::binary);
  if (error || !file_) throw InputError(path, "", "", "cannot be read");
  if (!mcap::isMcap(path)) return;
  mcap_ = std::make_unique<mcap::Reader>(path);
  size_ = mcap_->size_bytes();
  skipped_ = mcap_->skipped_bytes();
}

LogReader::~LogReader() = default;

bool LogReader::whole() const { return !mcap_ || mcap_->whole(); }

void LogReader::seek(std::int64_t position_bytes) {
  position_ = position_bytes;
  if (mcap_) mcap_->seek(position_bytes);
}

std::optional<LogEvent> LogReader::nextOfMcap() {
  std::optional<LogEvent> event;
  while (!event) {
    auto placed = mcap_->next();
    if (!placed) break;
    if (placed->channel->message_encoding != mcap::kLcmEncoding) continue;
    const mcap::Message& m = placed->message;
    event.emplace();
    event->number = m.sequence;
    event->time_us = static_cast<std::int64_t>(m.log_time_ns / 1000);
    event->position_bytes = placed->position_bytes;
    event->channel = placed->channel->topic;
    event->bytes.assign(m.data.begin(), m.data.end());
  }
  position_ = mcap_->position_bytes();
  skipped_ = mcap_->skipped_bytes();
  return event;
}

std::optional<LogEvent> LogReader::next() {
  if (mcap_) return nextOfMcap();
  std::array<char, kLogHeader_bytes> header{};
  while (size_ - position_ >= static_cast<std::int64_t>(kLogHeader_bytes)) {
    file_.seekg(position_);
    if (!file_.read(header.data(), header.size())) break;
    const auto channel_length = bigEndian<std::int32_t>(&header[20]);
    const auto data_length = bigEndian<std::int32_t>(&header[24]);
    const std::int64_t behind = size_ - position_ - static_cast<std::int64_t>(kLogHeader_bytes);
    const bool sound = bigEndian<std::uint32_t>(header.data()) == kLogMagic && channel_length > 0 &&
                       channel_length < static_cast<std::int32_t>(kLogMaxChannel_bytes) && data_length >= 0 &&
                       std::int64_t{channel_length} + data_length <= behind;
    if (!sound) {
      skipDamage();
      continue;
    }
    LogEvent event;
    event.position_bytes = position_;
    event.number = bigEndian<std::int64_t>(&header[4]);
    event.time_us = bigEndian<std::int64_t>(&header[12]);
    event.channel.resize(static_cast<std::size_t>(channel_length));
    event.bytes.resize(static_cast<std::size_t>(data_length));
    file_.read(event.channel.data(), channel_length);
    file_.read(reinterpret_cast<char*>(event.bytes.data()), data_length);
    if (!file_) break;  // The file has become shorter while it is read.
    position_ += static_cast<std::int64_t>(kLogHeader_bytes) + channel_length + data_length;
    return event;
  }
  skipped_ += size_ - position_;
  position_ = size_;
  return std::nullopt;
}

void LogReader::skipDamage() {
  std::array<char, 1 << 16> block{};
  file_.seekg(position_ + 1);
  file_.read(block.data(), block.size());
  const std::string_view read(block.data(), static_cast<std::size_t>(file_.gcount()));
  file_.clear();
  const std::size_t found = read.find(std::string_view("\xED\xA1\xDA\x01", 4));
  // The word may begin in the last three bytes of the block.
  const std::size_t step = 1 + (found != read.npos ? found : read.size() > 3 ? read.size() - 3 : 0);
  position_ += static_cast<std::int64_t>(step);
  skipped_ += static_cast<std::int64_t>(step);
}

std::optional<std::string> logFileOf(const std::string& url) {
  const std::string scheme = "file://";
  const std::size_t options = url.find('?');
  if (url.compare(0, scheme.size(), scheme) != 0 || options == std::string::npos) return std::nullopt;
  const std::string rest = url.substr(options + 1) + "&";
  if (("&" + rest).find("&speed=0&") == std::string::npos) return std::nullopt;
  return url.substr(scheme.size(), options - scheme.size());
}

std::int64_t wallClock_us() {
  using namespace std::chrono;
  return duration_cast<microseconds>(system_clock::now().time_since_epoch()).count();
}

void LogWriter::append(std::int64_t number, std::int64_t time_us, const std::string& channel, const std::uint8_t* data,
                       std::size_t size) {
  if (!file_.isOpen()) return;
  if (channel.empty() || channel.size() >= kLogMaxChannel_bytes || size > std::numeric_limits<std::int32_t>::max()) {
    (void)file_.finish();
    return fail(std::generic_category().message(EMSGSIZE));
  }
  std::string head;
  appendBigEndian(head, kLogMagic, 4);
  appendBigEndian(head, static_cast<std::uint64_t>(number), 8);
  appendBigEndian(head, static_cast<std::uint64_t>(time_us), 8);
  appendBigEndian(head, channel.size(), 4);
  appendBigEndian(head, size, 4);
  head += channel;
  if (const auto cause = file_.append({head, {reinterpret_cast<const char*>(data), size}})) return fail(*cause);
  ++messages_;
}

void LogWriter::write(const std::string& channel, const std::uint8_t* data, std::size_t size) {
  append(messages_, wallClock_us(), channel, data, size);
}

void LogWriter::write(const LogEvent& event) {
  append(event.number, event.time_us, event.channel, event.bytes.data(), event.bytes.size());
}

std::optional<std::string> LogWriter::finish() {
  if (const auto cause = file_.finish()) fail(*cause);
  return failure_;
}

void LogWriter::fail(const std::string& cause) {
  // When the file cannot be cut either, a reader skips the piece of a message at its end.
  failure_ = file_.path() + ": recording ended: " + cause + "; it holds the first " + std::to_string(messages_) +
             " messages" + (file_.endsWhole() ? "" : ", and perhaps a piece of the next");
}

}  // namespace angio::messaging
