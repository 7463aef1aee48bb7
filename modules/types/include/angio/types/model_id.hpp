// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>

#include "angio/types/namespace.hpp"

namespace angio::types {

/// Which vessel tree a program goes by, for messages in its model frame: programs must not obey each other's poses if
/// their trees differ. Nothing to keep secret or to sign: it tells trees apart that were mixed up.
enum class ModelId : std::int64_t { kUnknown = 0 };

}  // namespace angio::types
