// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/se3.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// From RegistrationResult's covariance (t; rotation in camera axes) to PosePrior's (twist about the centroid, model
/// axes), both of the same uncertainty of `T_camera_model`, to first order. They may be singular.
Matrix6d covarianceAboutCentroid(const Matrix6d& of_result, const Pose& T_camera_model,
                                 const Eigen::Vector3d& centroid_model);

/// The way back: from PosePrior's covariance to RegistrationResult's.
Matrix6d covarianceOfResult(const Matrix6d& about_centroid, const Pose& T_camera_model,
                            const Eigen::Vector3d& centroid_model);

}  // namespace angio::registration
