// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "place_grid.hpp"

namespace angio::localisation {

/// Displacements of the vessels that a catheter lies in, as a Gaussian process along the tree: known at some places,
/// linear between them, and fading beyond.
///
/// Ornstein and Uhlenbeck's: of two nodes that are d apart the further one is exp(-d/length) of the nearer one, give or
/// take std sqrt(1 - exp(-2 d/length)); on a tree that is a chain of independent steps.
class PlaceField {
 public:
  /// A node's place and its nearest node on the way to the root.
  struct Node {
    int place = 0;
    int parent = -1;  ///< Index of a node; -1 at the root.
  };
  /// A place between two nodes: (1 - weight) of a and weight of b.
  struct Between {
    int a = 0, b = 0;
    double weight = 0;
  };

  /// Nodes about every `step_m` along the ways from `tips` to their roots.
  PlaceField(const PlaceGrid& grid, const std::vector<int>& tips, double step_m);

  const std::vector<Node>& nodes() const { return nodes_; }

  /// Where a place of the ways lies; nothing for other places.
  std::optional<Between> at(int place) const;

  /// Displacements of all places (3 x N [m]) from the nodes' (3 x M [m]).
  Eigen::Matrix3Xd spread(const Eigen::Matrix3Xd& of_nodes_m, double length_m) const;

 private:
  const PlaceGrid& grid_;
  std::vector<Node> nodes_;
  std::vector<int> node_below_;  // Of each place: the node at it or the next one towards the tip; -1 off the ways.
};

}  // namespace angio::localisation
