// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

#include "angio/conventions/namespace.hpp"

namespace angio::conventions {

/// Rz(z) Rx(x) Ry(y): the Euler angles of ITK's Euler3DTransform, of RTK and of DiffDRR's "ZXY". @param x_y_z_rad  The
/// angles about x, y and z [rad], whatever their order in a file.
Eigen::Matrix3d rotationZxy(const Eigen::Vector3d& x_y_z_rad);

/// The inverse, with x within +-90 deg; at +-90 deg, where y and z turn about one line, y is 0 by choice.
Eigen::Vector3d eulerZxy(const Eigen::Matrix3d& R);

}  // namespace angio::conventions
