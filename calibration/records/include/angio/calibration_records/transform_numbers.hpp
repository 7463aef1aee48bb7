// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/calibration_records/namespace.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::calibration_records {

/// What the six numbers of a transform are called in a record: "T_dsa_cb_x_mm", ..., "T_dsa_cb_turn_z_deg". As values
/// they are its translation and rotation vector, in a covariance a change of its place and a small turn about its
/// parent's axes.
std::vector<std::string> transformNumberNames(const std::string& transform);

/// A unit of each in SI [m, rad].
Vector6d transformNumberUnits();

}  // namespace angio::calibration_records
