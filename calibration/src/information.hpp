// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/calibration/namespace.hpp"
#include "angio/calibration_records/record.hpp"

namespace angio::calibration {

/// The covariance of an information matrix, scaled to a unit diagonal before it is inverted: metres beside radians and
/// pixels would cost digits. `floor` on the diagonal gives what cannot be known a large variance, not an infinite one.
Eigen::MatrixXd covarianceOf(const Eigen::MatrixXd& information, double floor = 0);

/// How well parameters can be told apart, from their covariance.
///
/// The information matrix is scaled to a unit diagonal, so that a parameter counts in units of the standard deviation
/// it would have if all others were known. A direction is weak when its eigenvalue there is below 1 / `threshold`: the
/// data leave it open sqrt(threshold) times wider than that. It is named by the parameters that share in it, with what
/// each changes by while the first changes by one: "fx_px + 0.19 z_mm". Throws InputError when the covariance has
/// another size, is not finite, or has a variance that is not positive.
struct Observability {
  double condition = 1;                        ///< Largest over smallest eigenvalue.
  std::vector<WeakDirection> weak_directions;  ///< The weakest first.
};
Observability observability(const std::vector<std::string>& parameters, const Eigen::MatrixXd& covariance,
                            double threshold = 100);

/// Fills condition and weak directions of a record by its covariance.
void recordObservability(CalibrationRecord& record);

}  // namespace angio::calibration
