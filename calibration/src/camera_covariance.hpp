// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "camera_bundle.hpp"

namespace angio::calibration {

/// Everything that a camera's covariances are made of.
struct JointCovariance {
  Eigen::MatrixXd values;              ///< Of the bundle's values.
  std::vector<Eigen::MatrixXd> views;  ///< Of the values, then the pose, of each view.
  Eigen::RowVectorXd mean_depth;       ///< Of the phantom's mean depth [m] with the values; then its own variance.
  double left_out_squared_px2 = 0;     ///< Of all beads' residuals by the others.
  double freedom = 1;                  ///< Residuals less numbers that the beads determine.
};

/// Of a solved bundle, to first order about the solution. A bead's variance is `noise_px` squared, or as measured when
/// that is 0. `map_covariance_px2` is of each axis' coefficients of the known polynomial map, or empty: an error of the
/// map is common to all beads of all views.
JointCovariance jointCovariance(const CameraBundle& bundle, const Eigen::Vector3d& center_m, double noise_px,
                                const Eigen::MatrixXd& map_covariance_px2);

/// Variance of a bead's axis by the residuals of a solved bundle, in units of its own.
double measuredVariance(const CameraBundle& bundle);

}  // namespace angio::calibration
