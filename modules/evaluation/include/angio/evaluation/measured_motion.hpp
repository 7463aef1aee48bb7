// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <string>

#include "angio/evaluation/namespace.hpp"

namespace angio::evaluation {

/// A motion of tissue that was measured: where points of it lay, and by how much each moved; both 3 x N [m], any axes.
struct MeasuredMotion {
  Eigen::Matrix3Xd points, displacements_m;
};

/// Reads correspondences (CSV: x_mm,y_mm,z_mm,moved_x_mm,moved_y_mm,moved_z_mm), at least 20 that do not all lie in one
/// place. Throws InputError that names file, line, field, value and rule.
MeasuredMotion readMeasuredMotion(const std::string& path);

}  // namespace angio::evaluation
