// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "oriented_model.hpp"

namespace angio::registration {

/// Where displacements are unknown: nodes along the vessels, linear in between. Ends and bifurcations are nodes.
struct DeformationNodes {
  DeformationNodes(const OrientedModel& model, double spacing_m);

  Eigen::Matrix3Xd points;                 ///< 3 x M, about the centroid [m].
  std::vector<std::pair<int, int>> edges;  ///< Parent and child; a parent comes before its children.

  /// A model point lies on edge `edge`, `weight` of the way from its parent to its child; a point without vessel on
  /// none (-1).
  struct Place {
    int edge = -1;
    double weight = 0;
  };
  std::vector<Place> place_of_point;  ///< One per model point.

  /// A model edge lies on edge `edge`, from `begin` to `end` of its way; where it passes a node, the larger part
  /// counts.
  struct Stretch {
    int edge = 0;
    double begin = 0, end = 1;
    Place at(double share) const { return {edge, begin + share * (end - begin)}; }
  };
  std::vector<Stretch> stretch_of_edge;  ///< One per edge of the model.

  int size() const { return static_cast<int>(points.cols()); }

  /// Displacements of the model's points, 3 x N, from those of the nodes, 3 x M.
  Eigen::Matrix3Xd atPoints(const Eigen::Matrix3Xd& at_nodes) const;
};

/// A smooth random field as few modes: values at the nodes are modes * w with w standard normal.
///
/// M x K, columns by falling size. The covariance is std^2 (1 + d / L + d^2 / 3 L^2) exp(-d / L), d the distance of two
/// nodes: a field with two derivatives (Matern 5/2), not so smooth that a few places decide on all others. Its pivoted
/// Cholesky factor, whose pivots are the control points, is turned to its main axes.
Eigen::MatrixXd smoothModes(const Eigen::Matrix3Xd& nodes, double std_m, double length_m, int most);

}  // namespace angio::registration
