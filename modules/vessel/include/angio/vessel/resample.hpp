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

  /// Returns what the original's points have of something that `tree`'s points have, 3 x M: 3 x N.
  Eigen::Matrix3Xd ofOriginal(const Eigen::Matrix3Xd& of_tree) const;
};

/// Puts points on the tree so that no edge is longer than `spacing_m` [m]; all points of the original stay. A tree that
/// would then have more than `max_points` is walked in equal steps instead, and keeps its roots, bifurcations and ends.
/// `spacing_m` = 0 keeps the edges as they are. Points come branch by branch, each after its parent.
ResampledTree resampled(const VesselTree& tree, double spacing_m, int max_points);

/// Returns the arc length of each point of a chain, from its start [m].
std::vector<double> arcLengths(const VesselTree& tree, const std::vector<int>& chain);

/// Returns the index of the tree's point that is nearest to a place, model frame [m].
Eigen::Index nearestPoint(const VesselTree& tree, const Eigen::Vector3d& place_m);

}  // namespace angio::vessel
