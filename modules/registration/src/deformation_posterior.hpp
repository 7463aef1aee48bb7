// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <memory>
#include <vector>

#include "deformation_process.hpp"
#include "pose_prior_term.hpp"
#include "residual_groups.hpp"
#include "tree_error.hpp"

namespace angio::registration {

/// Pose and deformation of a tree together, given what an image shows of it: a normal distribution.
///
/// Before the image is looked at the deformation is a DeformationProcess of unknown amplitude in all three directions,
/// and the pose is as it is believed. A residual is linear in both; what the model is off over millimetres, which also
/// displaces it, and the image's noise come on top, and all amplitudes are found from the residuals (errorSizes).
/// Without a deformation the result is the rigid fit. What the image cannot tell apart, as growth of the tree and its
/// distance, stays with the belief, and the covariance says how open that is.
///
/// Residuals of several moments are of one pose; the displacements are those of the last moment, the newest.
class DeformationPosterior final : public TreeError {
 public:
  /// @param groups    About T_camera_centered and no displacement; at least kMinGroups.
  /// @param belief    Of the pose before the image.
  /// @param length_m  Over which a deformation goes together.
  /// @param shape     Of the process.
  DeformationPosterior(const std::vector<ResidualGroup>& groups, const PosePriorTerm& belief,
                       const Pose& T_camera_centered, double length_m, const ProcessShape& shape);

  /// The same of several moments.
  /// @param sizes  Of the errors, as errorSizes() finds them in one of the moments.
  DeformationPosterior(const std::vector<ResidualGroup>& groups, Moments moments, const ErrorSizes& sizes,
                       const PosePriorTerm& belief, const Pose& T_camera_centered, double length_m,
                       const ProcessShape& shape);

  /// Returns whether there is a distribution: false where the system had no solution.
  bool known() const { return known_; }

  /// Returns the mean twist from T_camera_centered.
  const Twist& twist() const { return mean_; }

  /// Returns the mean displacements of places about the centroid [m], both 3 x M, model axes, at the newest moment or
  /// at another.
  Eigen::Matrix3Xd displacements(const Eigen::Matrix3Xd& at) const { return displacements(at, newest()); }
  Eigen::Matrix3Xd displacements(const Eigen::Matrix3Xd& at, Eigen::Index moment) const;

  /// Returns what the mean leaves of the groups' residuals, over the standard deviation that they should have.
  Eigen::VectorXd normalizedLeftover() const;

  Eigen::Matrix3d pointCovariance(const Eigen::Vector3d& at) const override;
  std::shared_ptr<const TreeError> central() const override;

 private:
  // What the covariances of the amplitudes need; false where there is none.
  bool decompose();
  Eigen::Index newest() const { return moments_.deformation.cols() - 1; }
  const auto factor() const { return lower_.triangularView<Eigen::Lower>(); }
  Eigen::ArrayXd ofGroups(const Eigen::MatrixXd& by_moment, Eigen::Index moment) const;

  ResidualArrays groups_;
  Moments moments_;
  DeformationProcess process_;
  Eigen::MatrixXd lower_;  // L of L L^T, the residuals' covariance, the pose known.
  Eigen::Matrix<double, Eigen::Dynamic, 6> whitened_jacobian_;
  Eigen::VectorXd weights_;  // Of the groups' residuals in a displacement.
  Eigen::VectorXd noise_px2_;
  Matrix6d information_ = Matrix6d::Zero();  // Of the belief.
  Twist mean_ = Twist::Zero();
  double local_m_ = 0, tails_ = 1;
  bool known_ = false;
};

}  // namespace angio::registration
