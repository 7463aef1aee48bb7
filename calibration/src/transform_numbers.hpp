// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/calibration/namespace.hpp"
#include "angio/calibration_records/record.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::calibration {

/// What the six numbers of a transform are called in a record: "T_dsa_cb_x_mm", ..., "T_dsa_cb_turn_z_deg". As values
/// they are its translation and rotation vector, in a covariance a change of its place and a small turn about its
/// parent's axes.
std::vector<std::string> transformNumberNames(const std::string& transform);

/// A unit of each in SI [m, rad].
Vector6d transformNumberUnits();

/// Their values for a transform, in the record's units.
Vector6d transformNumbers(const Pose& T);

/// Fills a record's parameters, values, covariance and what can be told apart from transforms and their covariance, six
/// rows each [m, rad].
void recordTransforms(CalibrationRecord& record, const std::vector<std::pair<std::string, Pose>>& transforms,
                      const Eigen::MatrixXd& covariance);

/// Fills condition and weak directions of a record by its covariance.
void recordObservability(CalibrationRecord& record);

}  // namespace angio::calibration
