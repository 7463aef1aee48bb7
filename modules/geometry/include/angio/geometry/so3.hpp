// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>

#include "angio/geometry/namespace.hpp"

namespace angio::geometry {

/// Returns the left Jacobian of SO(3) at the rotation vector `w` [rad], the integral of exp(s [w]) over s in [0, 1]:
/// exp([w + dw]) is exp([Jl dw]) exp([w]) to first order, and d exp([w]) q / dw is -[exp([w]) q] Jl.
/// Source: Barfoot, State Estimation for Robotics (2017), eq. 7.37 and 7.77.
Eigen::Matrix3d leftJacobianSO3(const Eigen::Vector3d& w);

}  // namespace angio::geometry
