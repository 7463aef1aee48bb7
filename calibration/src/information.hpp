// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/calibration_records/record.hpp"
#include "angio/geometry/decompositions.hpp"

namespace angio::calibration {

/// The covariance of an information matrix, scaled to a unit diagonal before it is inverted: metres beside radians and
/// pixels would cost digits. `floor` on the diagonal gives what cannot be known a large variance, not an infinite one.
inline Eigen::MatrixXd covarianceOf(const Eigen::MatrixXd& information, double floor = 0) {
  const Eigen::VectorXd scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  scaled.diagonal().array() += floor;
  const Eigen::MatrixXd inverse = inverseOfSymmetric(Eigen::MatrixXd(scaled));
  return scale.asDiagonal() * inverse * scale.asDiagonal();
}

/// Fills condition and weak directions of a record by its covariance.
inline void recordObservability(CalibrationRecord& record) {
  const Observability seen = observability(record.parameters, record.covariance);
  record.condition = seen.condition;
  record.weak_directions = seen.weak_directions;
}

}  // namespace angio::calibration
