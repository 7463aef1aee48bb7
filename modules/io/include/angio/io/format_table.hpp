// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/base/joined.hpp"
#include "angio/io/text.hpp"

namespace angio::io {

/// The first of a table of formats, each with an `extension`, that a path's name ends with. Throws InputError that
/// lists the extensions there are. @param or_else  What else would do, for that line: ", or a folder".
template <typename Formats>
const auto& formatOf(const std::string& path, const Formats& formats, const std::string& or_else = "") {
  std::vector<std::string> known;
  for (const auto& format : formats) {
    if (hasExtension(path, format.extension)) return format;
    known.emplace_back(format.extension);
  }
  throw InputError(path, "extension", extensionOf(path), "must be one of " + joined(known) + or_else);
}

}  // namespace angio::io
