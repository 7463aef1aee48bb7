// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// Image points that follow each other along a vessel, as one observation: weighted means over them.
struct ResidualGroup {
  Eigen::Vector3d at = Eigen::Vector3d::Zero();        ///< Matched place on the model, about the centroid [m].
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();  ///< Of the residual by a displacement there, model axes [px/m].
  Vector6d jacobian = Vector6d::Zero();                ///< Of the residual by the twist about the centroid.
  double residual_px = 0;                              ///< Across the vessel.
  double scatter_px2 = 0;                              ///< Variance of the points' residuals about residual_px.
  double weight = 0;                                   ///< Sum of the points' weights.
  double pull = 0;  ///< The same, with the group's part of the points that are in no group.
};

/// Finds how far a tree is bent against its model by what a rigid fit leaves, and what that does to the fit.
///
/// A tree that is bent, or was traced a little wrong, leaves residuals that go together along vessels and over
/// centimetres, and the pose has followed them. Three things explain a residual here, all Gaussian with zero mean:
/// - a deformation: a process with a Matern 5/2 correlation of length L, alike on every axis, and a linear map beside
/// it
///   (strain, and growth alike on all axes, of which one view sees only a change of depth);
/// - what the model is off over millimetres: an exponential correlation;
/// - the noise of the image, whose size is the scatter within groups.
/// Amplitudes are unknown. The restricted likelihood of the residuals (Patterson and Thompson 1971) is computed on a
/// grid of them, and their squares are averaged over what it leaves. The fit, which did not know of the deformation, is
/// a known linear function of it, and so is the error of every point.
class ModelError {
 public:
  /// No deformation.
  ModelError() = default;

  /// @param groups       Of the fit where it came to rest; some dozens. With fewer than 12 nothing is told.
  /// @param information  Of the fit (6 x 6, twist about the centroid, prior included).
  /// @param currency     What a squared residual counts in it [1/px^2].
  /// @param length_m     L.
  ModelError(std::vector<ResidualGroup> groups, const Matrix6d& information, double currency, double length_m);

  /// Returns the amplitude of the deformation: standard deviation, per axis, of what is not linear in it [m].
  double amplitude_m() const { return amplitude_m_; }

  /// Returns what the deformation adds to the covariance of the twist about the centroid, model axes.
  const Matrix6d& poseCovariance() const { return pose_; }

  /// Returns the covariance of where a point of the tree is against where the rigid pose puts it, by the model's error
  /// alone, model axes [m^2]. `at` is about the centroid [m].
  Eigen::Matrix3d pointCovariance(const Eigen::Vector3d& at) const;

 private:
  Eigen::Matrix3d deformationCovariance(const Eigen::Vector3d& a, const Eigen::Vector3d& b) const;
  void estimate(const Eigen::MatrixXd& deformed, const Eigen::MatrixXd& local);

  std::vector<ResidualGroup> groups_;
  Eigen::Matrix<double, 6, Eigen::Dynamic> gain_;  // How the twist follows a displacement of each group's vessel.
  double amplitude_m_ = 0, local_m_ = 0, length_m_ = 1, radius2_m2_ = 1;
  Matrix6d pose_ = Matrix6d::Zero();
};

}  // namespace angio::registration
