// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/evaluation/namespace.hpp"

namespace angio::evaluation {

/// Whether an MP4 file on its disk has this many pictures, of which the last can be read. A video writer does not say
/// when a write failed.
bool isWholeFilm(const std::string& path, int pictures);

}  // namespace angio::evaluation
