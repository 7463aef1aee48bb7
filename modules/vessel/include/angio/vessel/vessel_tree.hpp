// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "angio/vessel/namespace.hpp"

namespace angio::vessel {

/// What is wrong with a list of tree points: which point, which field, what it says, and the rule it breaks.
struct TreeDefect {
  int point = 0;
  std::string field;
  std::string value;
  std::string rule;
};

/// Centreline points of a pre-operative vessel tree (or forest), in the model frame [m].
///
/// Invariants: at least two points, all finite and within 10 m of the origin, every parent exists, no loops, at least
/// one edge, radii positive where known. A parent may stand after its child.
class VesselTree {
 public:
  /// The first defect of such a tree, or nothing when it is sound. Sizes: points 3 x N [m], parents N (-1 at a root),
  /// radii N [m].
  static std::optional<TreeDefect> findDefect(const Eigen::Matrix3Xd& points_m, const std::vector<int>& parents,
                                              const std::vector<std::optional<double>>& radii_m);

  /// Throws InputError when the tree has a defect. Empty `radii_m` means that none is known.
  VesselTree(Eigen::Matrix3Xd points_m, std::vector<int> parents, std::vector<std::optional<double>> radii_m = {});

  int size() const { return static_cast<int>(parents_.size()); }
  const Eigen::Matrix3Xd& points() const { return points_; }                   ///< 3 x N [m].
  const std::vector<int>& parents() const { return parents_; }                 ///< N, -1 at a root.
  const std::vector<std::optional<double>>& radii() const { return radii_; }   ///< N [m].
  const std::vector<std::vector<int>>& children() const { return children_; }  ///< N lists.
  const Eigen::Vector3d& centroid() const { return centroid_; }                ///< Mean of the points [m].

  /// Chains of point indices, root side first. A chain starts at a root or a bifurcation (whose point it shares with
  /// its siblings) and ends at the next bifurcation or at a leaf. Every edge is in exactly one chain.
  const std::vector<std::vector<int>>& branches() const { return branches_; }

  /// All points in an order in which each comes after its parent.
  std::vector<int> parentsFirst() const;

  /// Length of all edges [m].
  double length() const { return length_; }

  /// Unit tangents 3 x N, along the vessel away from the root. At a bifurcation the straightest child is followed.
  Eigen::Matrix3Xd tangents() const;

 private:
  Eigen::Matrix3Xd points_;
  std::vector<int> parents_;
  std::vector<std::optional<double>> radii_;
  std::vector<std::vector<int>> children_;
  std::vector<std::vector<int>> branches_;
  Eigen::Vector3d centroid_;
  double length_ = 0;
};

}  // namespace angio::vessel
