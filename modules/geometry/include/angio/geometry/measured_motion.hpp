// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

#include "angio/geometry/namespace.hpp"

namespace angio::geometry {

/// A motion of tissue that was measured: where points of it lay, and by how much each moved; both 3 x N [m], any axes.
struct MeasuredMotion {
  Eigen::Matrix3Xd points, displacements_m;
};

}  // namespace angio::geometry
