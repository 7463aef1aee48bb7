// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/vessel/vessel_tree.hpp"

namespace angio::vessel {

/// The tree with every radius known: those it has are kept, the others follow Murray's law.
///
/// Ends have `end_radius_m` [m]; where branches part, the cube of the parent's radius is the sum of the cubes of its
/// children's, up to 4 mm. A branch is constant but for its first millimetres, where it leaves its parent's radius
/// smoothly. A branch that knows some of its radii is interpolated between them. Throws InputError unless end_radius_m
/// is positive. Source: Murray, The physiological principle of minimum work, PNAS 12 (1926).
VesselTree withPlausibleRadii(const VesselTree& tree, double end_radius_m);

}  // namespace angio::vessel
