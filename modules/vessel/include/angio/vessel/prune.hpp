// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/vessel/vessel_tree.hpp"

namespace angio {

/// The forest without the edges that are longer than `longest_m` [m].
///
/// Some files join separate trees at one root by straight edges where there is no vessel; in the BraVa cerebral
/// arteries they are those above 10 mm. All points stay, in their order: one whose edge goes becomes a root, and one
/// that loses all its edges lies on no branch. Throws InputError when `longest_m` is not positive or no edge would be
/// left.
VesselTree withoutLongEdges(const VesselTree& tree, double longest_m);

}  // namespace angio
