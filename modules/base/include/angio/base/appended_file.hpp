// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>

#include "angio/base/namespace.hpp"

namespace angio::base {

/// A file that grows at its end while a program runs. Every write is checked; what was appended before a failure stays.
class AppendedFile {
 public:
  /// Replaces a file. Throws InputError that names it: not writable, a full disk, or written by another AppendedFile.
  explicit AppendedFile(const std::string& path);
  AppendedFile(const AppendedFile&) = delete;
  AppendedFile& operator=(const AppendedFile&) = delete;
  ~AppendedFile() { (void)close(); }

  /// Appends the pieces, all or none, and returns nothing; or why they could not be. The file is then cut back to what
  /// it held before, and closed. Does nothing, and returns nothing, on a closed file.
  [[nodiscard]] std::optional<std::string> append(std::initializer_list<std::string_view> pieces);

  /// Waits until the file is on its disk, and closes it. Returns why that failed.
  [[nodiscard]] std::optional<std::string> finish();

  bool isOpen() const { return file_ >= 0; }
  std::int64_t size_bytes() const { return bytes_; }

  /// Whether the file ends with a whole append(): it does, unless it could not be cut back after a failure.
  bool endsWhole() const { return ends_whole_; }

  const std::string& path() const { return path_; }

 private:
  std::optional<std::string> close();
  std::optional<std::string> fail(int error);

  std::string path_;
  int file_ = -1;  // Negative once it is closed.
  std::int64_t bytes_ = 0;
  bool ends_whole_ = true;
};

}  // namespace angio::base
