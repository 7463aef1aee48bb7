// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "deformation_equations.hpp"

namespace angio::registration {

/// A step of pose and field.
template <int D>
struct DeformationStep {
  Twist dx = Twist::Zero();
  Matrix6d pose_covariance =
      Matrix6d::Zero();  ///< Of modes: that of the twist, whatever the modes are; of nodes: zero.
  Eigen::Matrix<double, D, Eigen::Dynamic> change;  ///< Of the modes' weights, D x K, or of the nodes, D x M.
};

/// Solves data and priors for pose and modes together: nodes move by w modes^T, w (D x K) standard normal, and
/// `H_pose`, `g_pose` already hold data and prior of the pose. A dense system of 6 + D K unknowns. Nothing when it has
/// no solution.
template <int D>
std::optional<DeformationStep<D>> solveModes(const DeformationEquations<D>& data, const DeformationNodes& nodes,
                                             const Eigen::MatrixXd& modes,
                                             const Eigen::Ref<const Eigen::Matrix<double, D, Eigen::Dynamic>>& w,
                                             const Matrix6d& H_pose, const Vector6d& g_pose);

/// Independent corrections of each stretch of vessel: a normal field along the tree whose covariance falls off as
/// std^2 exp(-s / length) with the way s along the vessel. Its information matrix follows the tree, and so does the
/// system with the data: elimination from the leaves is exact and linear in the nodes.
struct ChainPrior {
  ChainPrior(const DeformationNodes& nodes, double std_m, double length_m);
  std::vector<double> own, along;  ///< Information: of nodes, and of edges (off the diagonal) [1/m^2].
};

/// Solves data and chain prior for the nodes' corrections `e` (D x M) with the pose kept; the change of them.
template <int D>
DeformationStep<D> solveChain(const DeformationEquations<D>& data, const DeformationNodes& nodes,
                              const ChainPrior& prior, const Eigen::Matrix<double, D, Eigen::Dynamic>& e);

}  // namespace angio::registration
