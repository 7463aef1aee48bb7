// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/log_writer.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <limits>
#include <system_error>
#include <utility>

#include "angio/base/errors.hpp"
#include "log_format.hpp"

namespace angio::messaging {
namespace {

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

LogWriter::LogWriter(const std::string& path) : path_(path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) == 0 && !S_ISREG(info.st_mode)) {
    throw InputError(path, "", "", "must be a regular file, or none yet");
  }
  file_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file_ < 0) throw InputError(path, "", "", "cannot be written: " + causeOf(errno));
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
