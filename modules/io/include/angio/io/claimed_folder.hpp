// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// A folder that a program writes several files into. It is made when there is none. While an object lives no other
/// can be made of the same folder, in this process or another: files of two runs would stand beside each other.
class ClaimedFolder {
 public:
  /// Throws InputError that names the folder when it cannot be made or written, when its disk is full, or while another
  /// program writes into it.
  explicit ClaimedFolder(const std::string& path);
  ClaimedFolder(const ClaimedFolder&) = delete;
  ClaimedFolder& operator=(const ClaimedFolder&) = delete;
  ~ClaimedFolder();

 private:
  int descriptor_;
};

}  // namespace angio::io
