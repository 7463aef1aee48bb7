// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/se3.hpp"
#include "angio/registration/namespace.hpp"
#include "angio/registration/result.hpp"
#include "angio/vessel/vessel_tree.hpp"
#include "rigid_step.hpp"

namespace angio::registration {

/// From RegistrationResult's covariance (t; rotation in camera axes) to PosePrior's (twist about the centroid, model
/// axes), both of the same uncertainty of `T_camera_model`, to first order. They may be singular.
Matrix6d covarianceAboutCentroid(const Matrix6d& of_result, const Pose& T_camera_model,
                                 const Eigen::Vector3d& centroid_model);

/// The inverse: from PosePrior's covariance to RegistrationResult's.
Matrix6d covarianceOfResult(const Matrix6d& about_centroid, const Pose& T_camera_model,
                            const Eigen::Vector3d& centroid_model);

/// A solver that still moves the picture by more than this has run out of iterations, not come to rest [px].
constexpr double kAtRest_px = 0.5;

/// Displacements that raise the alignment score by no more than this explain no more.
constexpr double kSameScore = 0.02;

/// Poses whose points lie further apart than this on average are different answers; nearer ones are one basin.
constexpr double kDifferentPose_m = 3e-3;

/// A result before anything is solved: at its start, with the points there are on either side.
RegistrationResult resultAt(const Pose& start, int points_3d, const XrayViews& views);

/// Fewer points than this on either side cannot hold six unknowns against noise: sets the status and says so.
bool tooFewPoints(RegistrationResult& result);

/// How uncertain the covariance leaves the places of the tree's points: standard deviation of their distance, rms over
/// the points [m].
double spread_m(const Matrix6d& covariance, const Pose& T_camera_model, const VesselTree& tree);

/// Sets status and reason from the alignment score of model and image, and from how well the image determines the pose,
/// of a rigid and of a deformed tree alike: depth under deformation is open in one view, so that such a result is
/// ambiguous.
void classify(const VesselTree& tree, RegistrationResult& result);

/// The same where the patient has moved since the pose was held: a shift of the whole is no deformation then.
void classifyInMotion(const VesselTree& tree, RegistrationResult& result);

/// The same as classify() when it is known how well the best different pose does (score over this pose's, 0 to 1): one
/// that fits nearly as well makes a fit ambiguous; and a fit without an alternative is believed when less of the image,
/// or of the model, is explained, as when contrast fills half of the tree, if the image holds it three times as well.
void classifyAgainst(double alternative_share, const VesselTree& tree, RegistrationResult& result);

/// Sets the ambiguity to how well the best different pose does; one that fits nearly as well makes a fit ambiguous.
void compareWithAlternative(double alternative_share, RegistrationResult& result);

/// Whether a system of a twist about the centroid (m, rad) leaves no direction open: lengths of a tree's size count
/// like radians.
bool isFullRank(const Matrix6d& H);

/// Covariance as RegistrationResult defines it, from the system at the solution and the pulls of all views; nothing
/// when it is not of full rank.
std::optional<Matrix6d> covarianceOf(const NormalEquations& at_solution, const std::vector<Pull>& pulls,
                                     const Pose& T_camera_centered, const Eigen::Vector3d& centroid);

}  // namespace angio::registration
