// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/types/model_id.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::vessel {

/// Of a tree's points, to the nanometre, in their order, and of their parents; radii do not count. The same on every
/// machine, by FNV-1a over 64-bit words. Never kUnknown.
ModelId modelId(const VesselTree& tree);

}  // namespace angio::vessel
