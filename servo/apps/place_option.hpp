// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/vessel/tree_map.hpp"

namespace angio {

/// The place of a tree that two options --<name>-branch and --<name>-mm name. Throws InputError that names the option
/// when the tree has no such place.
TreePlace placeOf(const TreeMap& map, const std::string& name, int branch, double mm);

}  // namespace angio
