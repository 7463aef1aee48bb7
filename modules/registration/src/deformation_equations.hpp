// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "deformation_nodes.hpp"
#include "line_step.hpp"
#include "oriented_frame.hpp"

namespace angio::registration {

/// Normal equations of a data term over the pose (T exp(dx)) and the displacements of the nodes. Each node moves in D
/// directions: 2, across the beam of a single view, or 3. Sparse: nodes meet along edges of the tree only.
template <int D>
struct DeformationEquations {
  using Block = Eigen::Matrix<double, D, D>;
  using Column = Eigen::Matrix<double, D, 1>;

  Matrix6d H = Matrix6d::Zero();                   ///< Pose with pose.
  Vector6d g = Vector6d::Zero();                   ///< Half the gradient of the sum of squares.
  std::vector<Eigen::Matrix<double, 6, D>> mixed;  ///< Pose with node.
  std::vector<Column> pull;                        ///< g of the nodes.
  std::vector<Block> own, along;                   ///< Node with itself; parent with child of an edge, symmetric.
  double weight = 0, squares_px2 = 0;              ///< Sums of w and w r^2.

  void clear(const DeformationNodes& nodes);

  /// Adds w r^2 of one residual r [px] of a place: J = dr/dx, h = dr/d(its displacement).
  void add(const DeformationNodes& nodes, const DeformationNodes::Place& place, double w, double r, const Vector6d& J,
           const Column& h);
};

/// A deformed model in one view: what the data terms are linearised at.
struct DeformedView {
  const XrayCamera& camera;
  Pose T_view_centered;
  const Eigen::Matrix3Xd& points;  ///< Displaced, about the centroid, 3 x N [m].
};

/// Model to image: every `stride`-th model point in view is pulled up the field, as an expectation-maximisation step
/// would; a point in the field of one vessel is certain to 1 / scale^2 across its own direction, and to `along` of that
/// along it.
template <int D>
void addFieldPull(const DeformedView& view, const OrientedModel& model, const DeformationNodes& nodes,
                  const Eigen::Matrix<double, 3, D>& directions, const KernelField& field,
                  const std::vector<HalfPlane>& in_view, const PullWeight& pull, int stride, double weight,
                  DeformationEquations<D>& to);

/// Image to model: every matched image point pulls its edge onto itself, across the edge. `tolerance_px` is the scale
/// of the Gaussian weight of its distance.
template <int D>
void addLinePull(const DeformedView& view, const OrientedModel& model, const DeformationNodes& nodes,
                 const Eigen::Matrix<double, 3, D>& directions, const OrientedPoints& image, const LineMatches& matches,
                 double tolerance_px, double weight, DeformationEquations<D>& to);

}  // namespace angio::registration
