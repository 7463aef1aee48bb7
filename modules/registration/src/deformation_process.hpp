// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "place_correlation.hpp"
#include "residual_groups.hpp"

namespace angio::registration {

/// n groups of residuals, a quantity at a time.
struct ResidualArrays {
  ResidualArrays() = default;
  explicit ResidualArrays(const std::vector<ResidualGroup>& groups);

  Eigen::Matrix3Xd at, gradient;  ///< 3 x n: see ResidualGroup.
  Eigen::VectorXd outwards;       ///< Of the residual by a growth about the centroid: at . gradient [px].
  Eigen::Matrix<double, Eigen::Dynamic, 6> jacobian;
  Eigen::VectorXd residual_px;
  Eigen::VectorXd noise_px2;  ///< Variance by the image's noise, whose size is the scatter within groups.
};

/// How the variance of a deformation is shared, over that of its smooth part.
struct ProcessShape {
  double growth;  ///< Of a growth alike on all axes, at the radius of gyration.
  /// Of the smooth part what goes together over L, L / 2 and L / 6; their sum is 1.
  double over_long, over_half, over_short;
  /// Factor on the amplitude that the residuals speak for: measured deformations differ in their ratio of strain to
  /// displacement by more than one amplitude can follow, and are not drawn from the process.
  double tails;
};

/// Of the error of a rigid fit.
inline constexpr ProcessShape kRigidShape{2, 0.5, 0.5, 0, 1.5};
/// Of a fit that deforms to one view. Trees that deform smoothly grow by more than a rigid fit's errors have it: depth
/// is then the belief's.
inline constexpr ProcessShape kOneViewShape{8, 0.5, 0.5, 0, 2.2};
/// Of a fit to several views, which tell depth, and of one across the beam of a view whose pose is held. Measured
/// motions of lungs carried over to brains, less a linear map: differences over 4, 9, 17, 31 and 52 mm have 0.03, 0.10,
/// 0.30, 0.68 and 1.0 of their variance, as a Matern 5/2 over 10 mm has it. They tell how large a deformation is; what
/// else is off is seen place by place (LocalMisfit), and by how much is explained (claimsOfViews).
inline constexpr ProcessShape kViewsShape{8, 0.1, 0.1, 0.8, 1};

/// What is expected of a tree's deformation before an image is looked at, for an amplitude of 1.
///
/// A Gaussian process with zero mean, of three parts: a smooth one, alike on every axis, whose correlation is that of
/// Matern 5/2 ones of three lengths; a linear map (strain, and growth alike on all axes, of which one view sees only a
/// change of depth); and a little that goes together over two centimetres only. The covariance of the displacements of
/// two places a and b is alike(a, b) I + growth() a b^T.
class DeformationProcess {
 public:
  /// A process of no extent: to be assigned to.
  DeformationProcess() = default;
  /// @param groups    The linear part has its size at their radius of gyration.
  /// @param length_m  L.
  DeformationProcess(const std::vector<ResidualGroup>& groups, double length_m, const ProcessShape& shape);

  /// Returns it for all pairs of two sets of places about the centroid [m], 3 x n and 3 x m: n x m.
  Eigen::MatrixXd alike(const Eigen::Matrix3Xd& a, const Eigen::Matrix3Xd& b) const;
  double growth() const;

  /// Returns the covariance of the displacement of one place.
  Eigen::Matrix3d covariance(const Eigen::Vector3d& at) const;

  /// Returns the covariance of the groups' residuals, n x n [px^2/m^2]: the lower triangle, and zeros above.
  Eigen::MatrixXd ofResiduals(const ResidualArrays& groups) const;

  /// Returns the covariance of the groups' residuals with the displacement of a place, n x 3 [px/m].
  Eigen::Matrix<double, Eigen::Dynamic, 3> withPlace(const ResidualArrays& groups, const Eigen::Vector3d& at) const;

  /// Returns for all of a set of places, 3 x m, the sums of those over the groups with these weights, 3 x m.
  Eigen::Matrix3Xd ofWeights(const ResidualArrays& groups, const Eigen::VectorXd& weights,
                             const Eigen::Matrix3Xd& at) const;

 private:
  std::vector<CorrelationPart> parts_;
  double radius2_m2_ = 1;
  ProcessShape shape_{0, 1, 0, 0, 1};
};

/// Returns the correlation, alike on every axis, of what a model is off over millimetres, for all pairs of two sets of
/// places, 3 x n and 3 x m: n x m.
Eigen::MatrixXd localCorrelation(const Eigen::Matrix3Xd& a, const Eigen::Matrix3Xd& b);

/// Returns for all of a set of places, 3 x m, the sums over the groups of weight, gradient and that correlation, 3 x m.
Eigen::Matrix3Xd localOfWeights(const ResidualArrays& groups, const Eigen::VectorXd& weights,
                                const Eigen::Matrix3Xd& at);

/// Returns the covariance of the groups' residuals by it, for an amplitude of 1, n x n [px^2/m^2]: the lower triangle,
/// and zeros above.
Eigen::MatrixXd localErrorOfResiduals(const ResidualArrays& groups);

/// Moments at which a tree was seen, and how its displacements at them go together before they are looked at: the same
/// deformation at all of them, one that grows and shrinks with what moves the patient, and shifts of the whole.
struct Moments {
  std::vector<Eigen::Index> of_group;                         ///< The moment of each group; empty: all are of one.
  Eigen::MatrixXd deformation = Eigen::MatrixXd::Ones(1, 1);  ///< Factors on the process's covariance, M x M.
  Eigen::MatrixXd shift_m2 = Eigen::MatrixXd::Zero(1, 1);     ///< Covariance of the shifts, per axis, M x M [m^2].

  Eigen::Index at(Eigen::Index group) const { return of_group.empty() ? 0 : of_group[static_cast<std::size_t>(group)]; }
};

/// Standard deviations of the things that explain a residual, each Gaussian with zero mean.
struct ErrorSizes {
  double deformation_m = 0;  ///< Per axis, of the smooth part of the deformation.
  double local_m = 0;        ///< Of what the model is off over millimetres.
  double together = 1;       ///< How many neighbours of an image's points err alike.
};

/// Finds the sizes. The restricted likelihood of the residuals (Patterson and Thompson 1971), in which the pose is
/// anything, is computed on a grid of them, and their squares are averaged over what it leaves. Of more than 64 groups
/// about 64 are asked.
ErrorSizes errorSizes(const DeformationProcess& process, std::vector<ResidualGroup> groups);

/// Returns the covariance of the groups' residuals without the image's noise [px^2]: the lower triangle.
///
/// @param amplitude_m  Of the deformation.
Eigen::MatrixXd covarianceOfResiduals(const DeformationProcess& process, const ResidualArrays& groups,
                                      const Moments& moments, double amplitude_m, double local_m);

/// Returns the restricted log likelihood of residuals of several moments, but for a constant: how well sizes and
/// moments explain them, whatever the pose is. Not finite where the system has no solution.
double restrictedLogLikelihood(const DeformationProcess& process, const std::vector<ResidualGroup>& groups,
                               const Moments& moments, const ErrorSizes& sizes);

/// With fewer observations beyond the pose's six unknowns nothing can be told of a deformation.
inline constexpr int kMinGroups = 12;

}  // namespace angio::registration
