// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/vessel/vessel_tree.hpp"

namespace angio::vessel {

/// A tree with other points on the same centrelines, and where the points of the original lie among them.
struct ResampledTree {
  VesselTree tree;

  /// For each point of the original: it lies between points a and b of `tree`, at (1 - weight) a + weight b.
  struct Place {
    int a = 0;
    int b = 0;
    double weight = 0;
  };
  std::vector<Place> place_of_original;
};

/// Puts points on the tree so that no edge is longer than `spacing_m` [m]; all points of the original stay. A tree that
/// would then have more than `max_points` is walked in equal steps instead, and keeps its roots, bifurcations and ends.
/// `spacing_m` = 0 keeps the edges as they are. Points come branch by branch, each after its parent.
ResampledTree resampled(const VesselTree& tree, double spacing_m, int max_points);

}  // namespace angio::vessel
