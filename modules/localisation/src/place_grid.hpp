// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/localisation/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::localisation {

/// Places on a tree where a tip may be, each after its parent, in equal steps along each branch. Bifurcations belong to
/// the branch that ends there, a root to the first branch that starts at it.
struct PlaceGrid {
  Eigen::Matrix3Xd points_m;    ///< 3 x N, model frame.
  Eigen::Matrix3Xd directions;  ///< 3 x N, along the vessel, away from the root.
  std::vector<int> parent;      ///< -1 at a root.
  std::vector<std::vector<int>> children;
  std::vector<int> branch;          ///< Index into VesselTree::branches().
  std::vector<double> arc_m;        ///< From the branch's start.
  std::vector<double> path_m;       ///< From the root.
  std::vector<int> last_of_branch;  ///< One a branch: the place at its end.
  double spacing_m = 0;             ///< Longest step.

  int size() const { return static_cast<int>(parent.size()); }
};

constexpr int kMaxPlaces = 20000;  ///< Larger trees get wider steps.

/// Throws InputError when `spacing_m` is not positive.
PlaceGrid makePlaceGrid(const VesselTree& tree, double spacing_m);

/// The place of a branch that is nearest to an arc length.
int placeAt(const PlaceGrid& grid, int branch, double arc_m);

}  // namespace angio::localisation
