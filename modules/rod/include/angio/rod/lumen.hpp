// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "angio/rod/namespace.hpp"
#include "angio/vessel/tree_topology.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::rod {

/// How a sphere stands in a lumen.
struct WallGap {
  double gap_m = 0;  ///< Room between the sphere and the wall; negative: how deep it is in the wall.
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();   ///< Of the gap by the sphere's centre; points off the wall.
  Eigen::Matrix3d curvature = Eigen::Matrix3d::Zero();  ///< Minus the gap's second derivative, positive semidefinite;
                                                        ///< the change of radius along the vessel is left out of it.
  int tube = 0;                                         ///< The tube that has the most room for it ...
  double weight = 0;  ///< ... and how far along its axis the nearest point is, 0 to 1.
};

/// The inside of a tree's vessels: the union of tubes with round ends along its edges, whose radius changes linearly.
/// The axis is smooth, and its corners are rounded over a radius: a vessel does not turn in much less, and the axes of
/// segmented ones have that much noise, on which no catheter would hang.
///
/// A sphere is looked for only in tubes that are near along the vessels to the one that it was in, so that vessels that
/// pass or touch each other stay apart. At a fork it is in the tube with the most room: between two branches the wall
/// has an edge, from which it slips to either side.
class Lumen {
 public:
  /// Throws InputError when a radius is not known: see withPlausibleRadii.
  explicit Lumen(const VesselTree& tree);

  /// The gap of a sphere of `radius_m` around `center` [m] among the tubes near `tube`.
  WallGap gapNear(int tube, const Eigen::Vector3d& center, double radius_m) const;

  /// The tube of a place on the tree.
  int tubeAt(const TreeLocation& place) const;

  /// The place on the tree at `weight` along a tube's axis.
  TreeLocation place(int tube, double weight) const;

  /// The same between two of the tree's points.
  EdgePoint edgePoint(int tube, double weight) const;

  const TreeTopology& map() const { return map_; }

 private:
  struct Tube {
    Eigen::Vector3d start, along;  // Start of the axis, and unit vector to its end.
    double length_m = 0, start_radius_m = 0, end_radius_m = 0;
    int branch = 0;
    double arc_m = 0, arc_length_m = 0;  // Along the branch, by the tree's points.
    EdgePoint edge;                      // Its start between two of the tree's points ...
    double edge_share = 1;               // ... and which share of the edge it is.
    std::array<int, 2> joints{};         // Where it meets others.
    std::vector<int> near;               // Tubes that share its part of the lumen, itself included.
  };
  void addEdge(const VesselTree& tree, const std::array<int, 4>& points, int branch, double arc_m, double arc_length_m);
  WallGap gapIn(const Tube& tube, const Eigen::Vector3d& center, double radius_m) const;
  void findNear();

  TreeTopology map_;
  std::vector<Tube> tubes_;
  std::vector<std::vector<int>> of_branch_;  // Tubes of each branch, root side first.
};

}  // namespace angio::rod
