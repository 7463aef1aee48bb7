// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/vessel/tree_topology.hpp"

namespace angio::vessel {

/// Length of the route from the root that leads to both places [m]; nothing where their roots differ.
std::optional<double> sharedRoute_m(const TreeTopology& tree, const TreeLocation& a, const TreeLocation& b);

/// How far apart two places are along the vessels [m]; where their roots differ, in a straight line.
double alongVessels_m(const TreeTopology& tree, const TreeLocation& a, const TreeLocation& b);

}  // namespace angio::vessel
