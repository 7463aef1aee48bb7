// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "angio/test/namespace.hpp"

namespace angio::test {

/// One reader of files, as the fuzzers and their replay see it.
struct FileReader {
  std::string name;  ///< Of its folder in the corpus.
  std::string file;  ///< What a file for it is called: its extension chooses the format.

  /// Reads a file, all of it, and asks of the value what the reader's documentation says. Throws what the reader
  /// throws, and std::logic_error when the value is not what was promised.
  std::function<void(const std::string& path)> read;

  /// Files of the corpus folder `beside` that a file for it may speak of; they must lie in its folder.
  std::vector<std::string> beside = {};

  /// Puts right what no change would get past, checksums; nothing where there are none.
  std::function<std::string(std::string content)> mended = {};
};

/// Every reader of files that the project has; those of volumes and meshes where their module is built.
const std::vector<FileReader>& fileReaders();

/// The readers of volumes and meshes.
std::vector<FileReader> volumeReaders();

/// The folder of a reader's files in the corpus, by its name; and the file it would read in a folder, with all that
/// must lie beside it already there.
std::string corpusOf(const std::string& reader);
std::string placeIn(const std::string& folder, const FileReader& reader);

/// Whether a file is refused, with a line that a user can read: it begins with the place and has no control characters.
/// Throws everything but an InputError, and std::logic_error for a message that is not so.
bool isRefused(const FileReader& reader, const std::string& path);

/// Throws std::logic_error that says what was promised unless it holds.
void promised(bool holds, const char* what);

}  // namespace angio::test
