// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>

#include "angio/vessel/vessel_tree.hpp"

namespace angio {

/// Which vessel tree a program goes by, for messages in its model frame: programs must not obey each other's poses if
/// their trees differ. Nothing to keep secret or to sign: it tells trees apart that were mixed up.
enum class ModelId : std::int64_t { kUnknown = 0 };

/// Of a tree's points, to the nanometre, in their order, and of their parents; radii do not count. The same on every
/// machine, by FNV-1a over 64-bit words. Never kUnknown.
ModelId modelId(const VesselTree& tree);

}  // namespace angio
