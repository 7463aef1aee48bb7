// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/io/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::io {

/// Reads a 2D centreline from CSV with a header: `x_px,y_px` and optionally `branch`, `tangent_rad`, `radius_px`,
/// `sigma_px`, `contrast` and `kind` (vessel or device), in any order. At least one point. Points of one branch need
/// not stand together in the file: they are brought together in their order. Tangents that are not given are estimated
/// as in makeCenterline.
///
/// Throws InputError that names file, line, field, value and rule; a column of another name is refused.
Centerline2d readCenterline(const std::string& path);

/// Writes what readCenterline reads, all columns that the centreline has. Throws InputError when the file cannot be
/// written or there is no point.
void writeCenterline(const std::string& path, const Centerline2d& centerline);

}  // namespace angio::io
