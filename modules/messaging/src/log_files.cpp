// SPDX-License-Identifier: GPL-2.0-or-later
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <limits>
#include <string_view>
#include <system_error>
#include <utility>

#include "angio/base/big_endian.hpp"
#include "angio/base/errors.hpp"
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

std::string causeOf(int error) { return std::generic_category().message(error); }

// Returns 0 or the error.
int writeAll(int file, const char* bytes, std::size_t size) {
  while (size > 0) {
    const ssize_t written = ::write(file, bytes, size);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    bytes += written;
    size -= static_cast<std::size_t>(written);
  }
  return 0;
}

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
}

std::optional<LogEvent> LogReader::next() {
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

LogWriter::LogWriter(const std::string& path) : path_(path) {
  struct stat info {};
  const bool is_new = ::lstat(path.c_str(), &info) != 0;
  if (::stat(path.c_str(), &info) == 0 && !S_ISREG(info.st_mode)) {
    throw InputError(path, "", "", "must be a regular file, or none yet");
  }
  // Cut only when it is ours: another program may be recording into it.
  file_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
  if (file_ < 0) throw InputError(path, "", "", "cannot be written: " + causeOf(errno));
  const bool taken = ::flock(file_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  // An empty file comes to be on a full disk, too: a byte is tried.
  const auto empty = [this] { return ::ftruncate(file_, 0) == 0; };
  if (!taken && empty() && ::pwrite(file_, "", 1, 0) == 1 && empty()) return;
  const std::string cause = taken ? "is being written by another program" : "cannot be written: " + causeOf(errno);
  ::close(std::exchange(file_, -1));
  if (!taken && is_new) ::unlink(path.c_str());
  throw InputError(path, "", "", cause);
}

void LogWriter::write(const std::string& channel, const std::uint8_t* data, std::size_t size) {
  if (file_ < 0) return;
  if (channel.empty() || channel.size() >= kLogMaxChannel_bytes || size > std::numeric_limits<std::int32_t>::max()) {
    return fail(EMSGSIZE);
  }
  using namespace std::chrono;
  const auto now_us = duration_cast<microseconds>(system_clock::now().time_since_epoch()).count();
  std::string head;
  appendBigEndian(head, kLogMagic, 4);
  appendBigEndian(head, static_cast<std::uint64_t>(messages_), 8);
  appendBigEndian(head, static_cast<std::uint64_t>(now_us), 8);
  appendBigEndian(head, channel.size(), 4);
  appendBigEndian(head, size, 4);
  head += channel;
  int error = writeAll(file_, head.data(), head.size());
  if (error == 0) error = writeAll(file_, reinterpret_cast<const char*>(data), size);
  if (error != 0) return fail(error);
  ++messages_;
  bytes_ += static_cast<std::int64_t>(head.size() + size);
}

std::optional<std::string> LogWriter::finish() {
  if (file_ >= 0 && ::fsync(file_) != 0) fail(errno);
  close();
  return failure_;
}

void LogWriter::close() {
  const int file = std::exchange(file_, -1);
  if (file >= 0 && ::close(file) != 0 && !failure_) fail(errno);
}

void LogWriter::fail(int error) {
  // When the file cannot be cut either, a reader skips the piece of a message at its end.
  const bool cut = file_ >= 0 && ::ftruncate(file_, bytes_) == 0;
  failure_ = path_ + ": recording ended: " + causeOf(error) + "; it holds the first " + std::to_string(messages_) +
             " messages" + (cut ? "" : ", and perhaps a piece of the next");
  close();
}

}  // namespace angio::messaging
