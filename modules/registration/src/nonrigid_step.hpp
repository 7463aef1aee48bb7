// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/SparseCholesky>
#include <array>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/registration/iterative_pnp_settings.hpp"
#include "angio/registration/xray_view.hpp"
#include "angio/vessel/vessel_tree.hpp"
#include "displacement_pairs.hpp"
#include "rigid_step.hpp"

namespace angio::registration {

/// The nonrigid half of the paper's eq. 4 with the pose kept: displacements r_i that minimise
/// sum_v sum_i weight_vi |pi_v(T_v_first T (p_i + r_i)) - target_vi|^2 + lambda2 E_reg(r), over all views v.
///
/// The system is sparse: E_reg couples points along the tree and with their 3D neighbours, the data term fills the 3 x
/// 3 blocks of the diagonal. Its pattern and elimination order depend on the tree only and are found once.
class NonrigidStep {
 public:
  NonrigidStep(const VesselTree& tree, const IterativePnpSettings& settings);

  /// One Gauss-Newton step for fixed weights and targets, one pull for each view, linearised at `displacements_m` (3 x
  /// N, model axes). Returns the new displacements [m], or nothing when the system could not be solved. `damping` makes
  /// it a step of Levenberg and Marquardt: a share of the system's diagonal that holds the displacements where they
  /// are.
  std::optional<Eigen::Matrix3Xd> solve(const XrayViews& views, const Pose& T_camera_model,
                                        const std::vector<Pull>& pulls, const Eigen::Matrix3Xd& displacements_m,
                                        double damping = 0);

  /// What it minimises [px^2]; infinite where a matched point is behind a source.
  double cost(const XrayViews& views, const Pose& T_camera_model, const std::vector<Pull>& pulls,
              const Eigen::Matrix3Xd& displacements_m) const;

  /// lambda2 * E_reg of displacements [m], in the cost's currency [px^2]; lengths count in mm as in the paper.
  double regulariser(const Eigen::Matrix3Xd& displacements_m) const;

 private:
  void addView(const XrayView& view, const Pose& T_camera_model, const Pull& pull,
               const Eigen::Matrix3Xd& displacements_m, Eigen::VectorXd& rhs);

  Eigen::Matrix3Xd points_m_;
  double own_weight_;                        // lambda2 w1
  std::vector<DisplacementPair> couplings_;  // Weights times lambda2.
  Eigen::SparseMatrix<double> system_;
  std::vector<double> regulariser_values_;          // Values of system_ without data.
  std::vector<std::array<int, 6>> diagonal_block_;  // Where the lower half of each 3 x 3 block lies among the values.
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> cholesky_;
};

/// Levenberg-Marquardt on the displacements, one step at a time, as the paper has it for both halves (section III-D).
class DampedNonrigid {
 public:
  /// Borrows the system.
  explicit DampedNonrigid(NonrigidStep& system) : system_(system) {}

  /// Returns displacements that cost no more than the given ones; nothing where no step is found that does.
  std::optional<Eigen::Matrix3Xd> step(const XrayViews& views, const Pose& T_camera_model,
                                       const std::vector<Pull>& pulls, const Eigen::Matrix3Xd& displacements_m);

 private:
  NonrigidStep& system_;
  Damping damping_;
};

}  // namespace angio::registration
