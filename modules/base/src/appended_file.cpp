// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/appended_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

#include "angio/base/errors.hpp"

namespace angio::base {
namespace {

std::string causeOf(int error) { return std::generic_category().message(error); }

// Returns 0 or the error.
int writeAll(int file, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return 0;
}

}  // namespace

AppendedFile::AppendedFile(const std::string& path) : path_(path) {
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

std::optional<std::string> AppendedFile::append(std::initializer_list<std::string_view> pieces) {
  if (file_ < 0) return std::nullopt;
  std::int64_t appended_bytes = 0;
  for (const std::string_view piece : pieces) {
    if (const int error = writeAll(file_, piece)) return fail(error);
    appended_bytes += static_cast<std::int64_t>(piece.size());
  }
  bytes_ += appended_bytes;
  return std::nullopt;
}

std::optional<std::string> AppendedFile::finish() {
  if (file_ >= 0 && ::fsync(file_) != 0) return fail(errno);
  return close();
}

std::optional<std::string> AppendedFile::close() {
  const int file = std::exchange(file_, -1);
  if (file < 0 || ::close(file) == 0) return std::nullopt;
  return causeOf(errno);
}

std::optional<std::string> AppendedFile::fail(int error) {
  ends_whole_ = ::ftruncate(file_, bytes_) == 0;
  (void)close();
  return causeOf(error);
}

}  // namespace angio::base
