// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::apps {

/// The place of a tree that two options --<name>-branch and --<name>-mm name. Throws InputError that names the option
/// when the tree has no such place.
TreeLocation placeOf(const TreeTopology& map, const std::string& name, int branch, double mm);

}  // namespace angio::apps
