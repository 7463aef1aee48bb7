// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/euler_zxy.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace angio::conventions {

Eigen::Matrix3d rotationZxy(const Eigen::Vector3d& x_y_z_rad) {
  return (Eigen::AngleAxisd(x_y_z_rad.z(), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(x_y_z_rad.x(), Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(x_y_z_rad.y(), Eigen::Vector3d::UnitY()))
      .toRotationMatrix();
}

Eigen::Vector3d eulerZxy(const Eigen::Matrix3d& R) {
  // The last row is (-cos x sin y, sin x, cos x cos y), the middle column (-sin z cos x, cos z cos x, sin x).
  const double cos_x = std::hypot(R(2, 0), R(2, 2));
  const double x = std::atan2(R(2, 1), cos_x);
  // Below it the rounding of R's entries is all that y and z would be taken from.
  if (cos_x < 1e-12) return {x, 0, std::atan2(R(1, 0), R(0, 0))};
  return {x, std::atan2(-R(2, 0), R(2, 2)), std::atan2(-R(0, 1), R(1, 1))};
}

}  // namespace angio::conventions
