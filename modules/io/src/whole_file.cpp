// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/whole_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <filesystem>
#include <system_error>

#include "angio/base/errors.hpp"

namespace angio::io {
namespace {

InputError failure(const std::string& path, const std::string& what, int error) {
  return InputError(path, "", "", what + ": " + std::generic_category().message(error));
}

class FileDescriptor {
 public:
  explicit FileDescriptor(int fd) : fd_(fd) {}
  ~FileDescriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;

  int get() const { return fd_; }
  int close() {
    const int fd = fd_;
    fd_ = -1;
    return ::close(fd);
  }

 private:
  int fd_;
};

// Takes the unfinished file away unless it was renamed.
struct TemporaryFile {
  std::string path;
  bool kept = false;
  ~TemporaryFile() {
    if (!kept) ::unlink(path.c_str());
  }
};

void requireName(const std::string& path) {
  if (path.empty()) throw InputError("file", "path", "", "must not be empty");
  if (path.find('\0') != std::string::npos) throw InputError(path, "path", "", "must not hold a NUL byte");
}

// The file that is written under this name: of a link the file that it leads to.
std::string targetOf(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_symlink(path, ignored)) return path;
  const auto linked = std::filesystem::weakly_canonical(path, ignored);
  return ignored ? path : linked.string();
}

// Returns 0 or the error.
int writeAll(int fd, const std::string& content) {
  std::size_t done = 0;
  while (done < content.size()) {
    const ssize_t n = ::write(fd, content.data() + done, content.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return errno;
    done += static_cast<std::size_t>(n);
  }
  return ::fsync(fd) == 0 ? 0 : errno;
}

}  // namespace

std::string readWholeFile(const std::string& path, std::size_t max_bytes) {
  requireName(path);
  // Non-blocking, because opening a pipe would otherwise wait for a writer.
  const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (file.get() < 0) throw failure(path, "cannot be opened", errno);
  struct stat info {};
  if (::fstat(file.get(), &info) != 0) throw failure(path, "cannot be examined", errno);
  if (!S_ISREG(info.st_mode)) {
    throw InputError(path, "", "", S_ISDIR(info.st_mode) ? "is a folder, not a file" : "is not a regular file");
  }
  const auto too_large = [&] {
    return InputError(path, "size", "", "must not exceed " + std::to_string(max_bytes) + " bytes");
  };
  if (static_cast<std::uintmax_t>(info.st_size) > max_bytes) throw too_large();
  std::string content(static_cast<std::size_t>(info.st_size), '\0');
  std::size_t done = 0;
  for (;;) {
    // The file may grow while it is read, and files in /proc say that they are empty.
    if (done == content.size()) content.resize(done + 65536);
    const ssize_t n = ::read(file.get(), content.data() + done, content.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw failure(path, "cannot be read", errno);
    if (n == 0) break;
    done += static_cast<std::size_t>(n);
    if (done > max_bytes) throw too_large();
  }
  content.resize(done);
  return content;
}

void writeWholeFile(const std::string& path, const std::string& content) {
  requireName(path);
  const std::string target = targetOf(path);
  struct stat info {};
  if (::stat(target.c_str(), &info) == 0 && !S_ISREG(info.st_mode)) {
    throw InputError(path, "", "", S_ISDIR(info.st_mode) ? "is a folder, not a file" : "is not a regular file");
  }

  static std::atomic<unsigned> counter{0};
  TemporaryFile temporary;
  int fd = -1;
  do {  // A crashed program with our process number may have left such a name behind.
    temporary.path = target + ".part-" + std::to_string(::getpid()) + "-" + std::to_string(counter++);
    fd = ::open(temporary.path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  } while (fd < 0 && errno == EEXIST);
  if (fd < 0) {
    temporary.kept = true;  // There is none to take away.
    throw failure(path, "cannot be written", errno);
  }
  FileDescriptor file(fd);
  if (const int error = writeAll(file.get(), content)) throw failure(path, "cannot be written", error);
  if (file.close() != 0) throw failure(path, "cannot be written", errno);
  if (::rename(temporary.path.c_str(), target.c_str()) != 0) throw failure(path, "cannot be written", errno);
  temporary.kept = true;
}

void requireFolderOf(const std::string& path) {
  if (path.empty()) return;
  const auto folder = std::filesystem::absolute(targetOf(path)).parent_path();
  if (!std::filesystem::is_directory(folder)) throw InputError(path, "", "", "its folder must exist");
  // writeWholeFile() makes a new file there, whatever the old one permits.
  if (::access(folder.c_str(), W_OK) != 0) throw failure(path, "cannot be written", errno);
  struct statvfs space {};
  if (::statvfs(folder.c_str(), &space) != 0) return;
  // What is kept for root is no space for others. File systems without a fixed number of files say that they have none.
  const auto free_blocks = ::geteuid() == 0 ? space.f_bfree : space.f_bavail;
  const bool full = space.f_blocks > 0 && free_blocks == 0, crowded = space.f_files > 0 && space.f_ffree == 0;
  if (full || crowded) throw failure(path, "cannot be written", ENOSPC);
}

}  // namespace angio::io
