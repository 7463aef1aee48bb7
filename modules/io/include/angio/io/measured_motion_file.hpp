// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/geometry/measured_motion.hpp"
#include "angio/io/namespace.hpp"

namespace angio::io {

/// Reads correspondences (CSV: x_mm,y_mm,z_mm,moved_x_mm,moved_y_mm,moved_z_mm), at least 20 that do not all lie in one
/// place. Throws InputError that names file, line, field, value and rule.
MeasuredMotion readMeasuredMotion(const std::string& path);

}  // namespace angio::io
