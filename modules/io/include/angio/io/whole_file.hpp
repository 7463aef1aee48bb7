// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <string>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// No file of this project is larger [bytes].
constexpr std::size_t kMaxFile = std::size_t{1} << 30;

/// The bytes of a regular file. Throws InputError that names it when it is missing, no regular file (a directory, a
/// pipe), unreadable, or larger than `max_bytes`.
std::string readWholeFile(const std::string& path, std::size_t max_bytes = kMaxFile);

/// Writes a file so that it appears whole or not at all: a temporary file in the same folder, flushed to the disk,
/// takes the name at the end. A file that stood there before stays untouched until then; a symbolic link keeps its
/// target. Throws InputError with path and reason, and leaves nothing behind.
void writeWholeFile(const std::string& path, const std::string& content);

/// Throws InputError when a file cannot come to be there: better before hours of work than after. An empty path is
/// none.
void requireFolderOf(const std::string& path);

}  // namespace angio::io
