// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/claimed_folder.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <system_error>

#include "angio/base/errors.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::io {

ClaimedFolder::ClaimedFolder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) throw InputError(path, "", "", "cannot be made: " + error.message());
  requireFolderOf((std::filesystem::path(path) / "").string());
  // The lock ends with the process, however it ends.
  descriptor_ = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor_ < 0) throw InputError(path, "", "", "cannot be opened: " + std::generic_category().message(errno));
  if (::flock(descriptor_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
  ::close(descriptor_);
  throw InputError(path, "", "", "is being written by another program");
}

ClaimedFolder::~ClaimedFolder() { ::close(descriptor_); }

}  // namespace angio::io
