// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/vessel/vessel_tree.hpp"
#include "angio/volume/namespace.hpp"

namespace angio::volume {

/// How much of one tree's length lies near another, and how far off it is.
struct Coverage {
  double share = 0;     ///< Of the length, 0 to 1.
  double median_m = 0;  ///< Of the distance to the other tree [m].
  double worst_m = 0;   ///< [m].
};

/// What of a tree is looked at: all, or what lies within the other tree's vessels (nearer to it than its radius there).
enum class CoverageScope { kAll, kInsideOther };

/// The part of `tree` that is within `distance_m` [m] of a line of `other`. Both are looked at every tenth of it.
/// A share of nothing is zero.
Coverage coverage(const VesselTree& tree, const VesselTree& other, double distance_m,
                  CoverageScope scope = CoverageScope::kAll);

}  // namespace angio::volume
