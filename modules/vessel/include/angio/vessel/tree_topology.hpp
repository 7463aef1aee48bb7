// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <optional>
#include <vector>

#include "angio/vessel/vessel_tree.hpp"

namespace angio::vessel {

/// A place on a tree.
struct TreeLocation {
  int branch = 0;    ///< Index of VesselTree::branches().
  double arc_m = 0;  ///< From the branch's start, along the vessel.
};

/// A place between two of the tree's points: at (1 - weight) a + weight b, wherever these have gone.
struct EdgePoint {
  int a = 0;
  int b = 0;
  double weight = 0;
};

/// Directions at a place of a vessel: along it, and two normal to it that turn no more than the vessel does.
///
/// `normal` and `binormal` complete `along` to a right-handed frame, carried from the root without twist: what is
/// pushed along the vessels from there keeps its roll against them.
struct TreeFrame {
  Eigen::Vector3d along = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitX();
  Eigen::Vector3d binormal = Eigen::Vector3d::UnitY();
};

/// A route on from the end of a branch.
struct TreeRoute {
  int child = 0;                                         ///< The branch that it begins with ...
  int last = 0;                                          ///< ... and the one in which it ends.
  double radius_m = 0;                                   ///< Of the vessel there.
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< From the fork to its end; length 1.
};

/// A tree's lengths, frames, and routes from one branch to another.
///
/// Branches are those of VesselTree::branches(); a branch's parent is the one that ends where it starts. Arc lengths
/// are clamped to their branch's length. Throws std::out_of_range for a branch that is not there.
class TreeTopology {
 public:
  explicit TreeTopology(const VesselTree& tree);

  int branchCount() const { return static_cast<int>(lines_.size()); }
  double length_m(int branch) const { return lines_.at(branch).arc_m.back(); }  ///< Of a branch.
  double start_m(int branch) const { return lines_.at(branch).start_m; }        ///< From its root to its start.
  const std::vector<int>& children(int branch) const { return lines_.at(branch).children; }
  std::optional<int> parent(int branch) const { return lines_.at(branch).parent; }       ///< None where a root is.
  const std::vector<int>& points(int branch) const { return lines_.at(branch).points; }  ///< Indices, root side first.

  /// The branches from the root to `branch`, both included.
  std::vector<int> pathTo(int branch) const;

  /// The tree's points from the root to a place, none twice: indices, root side first.
  std::vector<int> pointsTo(const TreeLocation& place) const;

  /// Whether the route from the root to `branch` leads through `other`, itself included.
  bool passes(int branch, int other) const;

  EdgePoint spot(const TreeLocation& place) const;
  Eigen::Vector3d point(const TreeLocation& place) const;  ///< Model frame [m].
  TreeFrame frame(const TreeLocation& place) const;        ///< Directions are means over some 2 mm to either side.

  /// The place `back_m` [m] nearer to the root along the vessels; the root where there is no more.
  TreeLocation before(const TreeLocation& place, double back_m) const;

  /// How far the vessel has turned from the root to here, all its bends added up [rad].
  double turned_rad(const TreeLocation& place) const;

  /// All routes on from the end of a branch, `length_m` [m] long, or shorter where the tree ends.
  std::vector<TreeRoute> routesFrom(int branch, double length_m) const;

  /// How far beyond the end of a branch the routes through its children still run inside each other's lumens [m]: up to
  /// there, what is in one of them is in the others, and forks of short branches are one. At most `max_m` and 12 mm;
  /// radii that the tree does not know count as 1 mm.
  double parting_m(int branch, double max_m = 12e-3) const { return std::min(lines_.at(branch).parting_m, max_m); }

 private:
  struct Line {
    std::vector<int> points;
    std::vector<double> arc_m, turned_rad, radius_m;  // At each of the points.
    std::vector<Eigen::Vector3d> place, along, normal;
    double start_m = 0, parting_m = 0;
    std::optional<int> parent;
    std::vector<int> children;
  };
  void layFrames(int branch);
  void addRoutes(int child, int branch, double left_m, const Eigen::Vector3d& from,
                 std::vector<TreeRoute>& routes) const;
  double radius_m(const TreeLocation& place) const;
  double findParting(int branch) const;

  std::vector<Line> lines_;
};

}  // namespace angio::vessel
