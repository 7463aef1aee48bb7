// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/registration/iterative_pnp_settings.hpp"
#include "angio/registration/oriented_kernel_settings.hpp"
#include "angio/registration/registration.hpp"
#include "angio/registration/result.hpp"

namespace angio::registration {

/// What is known of the pose before the image is looked at, as a quadratic form: xi^T information xi with
/// xi = log(T0^-1 T), for the pose of the centred tree (rotation about the centroid, paper eq. 3). It is E_init of the
/// paper's eq. 4, and with the inverse of a covariance the squared Mahalanobis distance.
///
/// The paper's T acts on the points after T_dsa_cb and the shift by -c. Here T0 holds both, which leaves
/// |log(T0^-1 T)| as it is up to a rotation of the axes.
struct PosePriorTerm {
  Pose T0_camera_centered = Pose::Identity();
  Matrix6d information = Matrix6d::Zero();  ///< Per m^2 and rad^2, in the unit that the data term counts in.
  PriorInForce source = PriorInForce::kSettingsCovariance;

  double cost(const Pose& T_camera_centered) const;

  /// Adds the term's Gauss-Newton Hessian and gradient (half of each) with respect to T exp(dx).
  void add(const Pose& T_camera_centered, Matrix6d& H, Vector6d& g) const;
};

/// The term that settings and prior ask for, in square pixels as the paper's data term.
PosePriorTerm priorTerm(const IterativePnpSettings& settings, const PosePrior& prior, const Eigen::Vector3d& centroid);

/// The prior's own covariance, or the settings' standard deviations; in units of a negative log-likelihood (twice).
PosePriorTerm beliefOf(const PosePrior& prior, const OrientedKernelSettings& settings, const Eigen::Vector3d& centroid);

/// Whether a pose lies within what the settings' own belief of a start holds with 99 %. A fit that ended farther away
/// began with more vessels that were matched with their neighbours.
bool isNearStart(const PosePriorTerm& usual_belief, const Pose& T_camera_centered);

/// The term of a method without a prior of its own, in square pixels as the data term of a match known to 1 px: what
/// came with the start, or nothing.
PosePriorTerm givenPrior(const PosePrior& prior, const Eigen::Vector3d& centroid);

/// Poses that a search begins at: the belief's own first, then draws around it. One seed, one row of draws.
class StartDraws {
 public:
  /// Normal with the belief's covariance, or even in the box that is to be searched.
  std::vector<Pose> poses(const PosePriorTerm& belief, const StartSettings& starts, int count);

  /// The same rotations and depths, all where the belief is in the plane: for a search that tries every shift.
  std::vector<Pose> withoutShift(const PosePriorTerm& belief, const StartSettings& starts, int count);

 private:
  std::vector<Vector6d> unit_draws_;  // Drawn once: seeding an engine costs more than a step.
  int seed_ = 0;
};

/// How far shifts are to be searched [m]: to the box's side, or so many standard deviations of the belief.
double shiftReach_m(const PosePriorTerm& belief, const StartSettings& starts, double standard_deviations);

}  // namespace angio::registration
