// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/servo/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::servo {

/// `count` points on the tree's centreline (3 x N [m]; fewer for a tree that has fewer places), spread well: points in
/// equal steps of arc length, of which each next one is the furthest from all before (Gonzalez 1985). The first is the
/// one furthest from the centroid.
Eigen::Matrix3Xd spreadSamples(const VesselTree& tree, int count);

}  // namespace angio::servo
