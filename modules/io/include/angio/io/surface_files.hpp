// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// A surface of flat pieces as it stands in a file.
struct Surface {
  Eigen::Matrix3Xd points_mm;              ///< 3 x N, in the file's axes [mm].
  std::vector<std::vector<int>> polygons;  ///< Corners in order, indices of points; at least three each.
};

/// Reads the polygons and strips of VTK's XML poly data (.vtp), strips as triangles; vertices, lines and all data at
/// points and cells are passed over. Throws InputError that names file, line, field, value and rule: broken XML, counts
/// that the file does not hold, points that are not finite or beyond 10 m, corners that are no points. A file without
/// polygons gives a surface without any.
Surface readVtpSurface(const std::string& path);

}  // namespace angio::io
