// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/volume/namespace.hpp"

namespace angio::volume {

/// Look at a header before a parser that trusts it does: what it claims must be well formed, three-dimensional and
/// within bounds, and the data must be in the file (or one file beside it). Throw InputError.
void checkMetaHeader(const std::string& path);
void checkNiftiHeader(const std::string& path);
void checkNrrdHeader(const std::string& path);

}  // namespace angio::volume
