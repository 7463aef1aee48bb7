// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "deformation_nodes.hpp"
#include "line_step.hpp"
#include "oriented_frame.hpp"

namespace angio::registration {

/// A deformed model in one view: what the data terms are linearised at.
struct DeformedView {
  const XrayCamera& camera;
  Pose T_view_centered;
  const Eigen::Matrix3Xd& points;  ///< Displaced, about the centroid, 3 x N [m].
};

/// Independent corrections of each stretch of vessel: a normal field along the tree whose covariance falls off as
/// std^2 exp(-s / length) with the way s along the vessel. Its information matrix follows the tree, and so does the
/// system with the data: elimination from the leaves is exact and linear in the nodes.
struct ChainPrior {
  ChainPrior(const DeformationNodes& nodes, double std_m, double length_m);
  std::vector<double> own, along;  ///< Information: of nodes, and of edges (off the diagonal) [1/m^2].
};

/// Normal equations of a data term over the pose (T exp(dx)) and the displacements of the nodes. Each node moves in D
/// directions: 2, across the beam of a single view, or 3. Sparse: nodes meet along edges of the tree only.
template <int D>
struct DeformationEquations {
  using Block = Eigen::Matrix<double, D, D>;
  using Column = Eigen::Matrix<double, D, 1>;
  using Field = Eigen::Matrix<double, D, Eigen::Dynamic>;
  using Directions = Eigen::Matrix<double, 3, D>;

  const DeformationNodes& nodes;
  const Directions directions;
  Matrix6d H = Matrix6d::Zero();                   ///< Pose with pose.
  Vector6d g = Vector6d::Zero();                   ///< Half the gradient of the sum of squares.
  std::vector<Eigen::Matrix<double, 6, D>> mixed;  ///< Pose with node.
  std::vector<Column> pull;                        ///< g of the nodes.
  std::vector<Block> own, along;                   ///< Node with itself; parent with child of an edge, symmetric.
  double weight = 0, squares_px2 = 0;              ///< Sums of w and w r^2.

  /// Borrows the nodes; `node_directions` are those that each may move in, model axes.
  DeformationEquations(const DeformationNodes& of_nodes, const Directions& node_directions)
      : nodes(of_nodes), directions(node_directions) {
    clear();
  }
  void clear();

  /// Adds w r^2 of one residual r [px] of a place: J = dr/dx, h = dr/d(its displacement).
  void add(const DeformationNodes::Place& place, double w, double r, const Vector6d& J, const Column& h);

  /// Adds model to image: every `stride`-th model point in view is pulled up the field, as an expectation-maximisation
  /// step would; a point in the field of one vessel is certain to 1 / scale^2 across its own direction, and to `along`
  /// of that along it. Near the border of the view the field lacks the vessels beyond it, and pulls inwards: there a
  /// point counts by its distance to the border over the reach of a kernel.
  void addFieldPull(const DeformedView& view, const OrientedModel& model, const KernelField& field,
                    const std::vector<HalfPlane>& in_view, const PullWeight& pull_weight, int stride,
                    double view_weight);

  /// Adds image to model: every matched image point pulls its edge onto itself, across the edge. `tolerance_px` is the
  /// scale of the Gaussian weight of its distance.
  void addLinePull(const DeformedView& view, const OrientedModel& model, const OrientedPoints& image,
                   const LineMatches& matches, double tolerance_px, double view_weight);

  /// A step of pose and field.
  struct Step {
    Twist dx = Twist::Zero();
    /// Of modes: that of the twist, whatever the modes are; of nodes: zero.
    Matrix6d pose_covariance = Matrix6d::Zero();
    Field change;  ///< Of the modes' weights, D x K, or of the nodes, D x M.
  };

  /// Solves data and priors for pose and modes together: nodes move by w modes^T, w (D x K) standard normal, and
  /// `H_pose`, `g_pose` already hold data and prior of the pose. A dense system of 6 + D K unknowns. Nothing when it
  /// has no solution.
  std::optional<Step> solveModes(const Eigen::MatrixXd& modes, const Eigen::Ref<const Field>& w, const Matrix6d& H_pose,
                                 const Vector6d& g_pose) const;

  /// Solves data and chain prior for the nodes' corrections `e` (D x M) with the pose kept; the change of them.
  Step solveChain(const ChainPrior& prior, const Field& e) const;
};

}  // namespace angio::registration
