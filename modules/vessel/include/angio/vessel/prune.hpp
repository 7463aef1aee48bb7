// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/vessel/vessel_tree.hpp"

namespace angio::vessel {

/// The forest without the edges that are longer than `max_m` [m].
///
/// Some files join separate trees at one root by straight edges where there is no vessel; in the BraVa cerebral
/// arteries they are those above 10 mm. All points stay, in their order: one whose edge goes becomes a root, and one
/// that loses all its edges lies on no branch. Throws InputError when `max_m` is not positive or no edge would be
/// left.
VesselTree withoutLongEdges(const VesselTree& tree, double max_m);

/// The tree that begins at its point nearest to `place_m` [m], model frame, whatever its root was. It is cut through
/// there, and of the pieces that meet at the cut the one with the most length of vessels stays; other trees of a forest
/// go. Points come in another order, with their radii. Throws InputError when `place_m` is not finite.
VesselTree beginningAt(const VesselTree& tree, const Eigen::Vector3d& place_m);

}  // namespace angio::vessel
