// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/undistort.hpp"

#include <cmath>

namespace angio::vessel {

Centerline2d undistorted(const Centerline2d& seen, const DetectorDistortion& distortion) {
  Centerline2d line = seen;
  std::vector<bool> keep(static_cast<std::size_t>(seen.size()), false);
  for (Eigen::Index i = 0; i < seen.points_px.cols(); ++i) {
    Eigen::Matrix2d J;
    const auto point_px = distortion.undistorted(seen.points_px.col(i), &J);
    if (!point_px) continue;
    keep[static_cast<std::size_t>(i)] = true;
    line.points_px.col(i) = *point_px;
    const Eigen::Vector2d along = J * Eigen::Vector2d(std::cos(seen.tangent_rad[i]), std::sin(seen.tangent_rad[i]));
    line.tangent_rad[i] = undirected(std::atan2(along.y(), along.x()));
    // Across the curve: the area's change over the length's.
    const double across = std::abs(J(0, 0) * J(1, 1) - J(0, 1) * J(1, 0)) / along.norm();
    if (line.radius_px.size() > 0) line.radius_px[i] *= across;
    if (line.std_px.size() > 0) line.std_px[i] *= across;
  }
  return pointsWhere(line, keep);
}

}  // namespace angio::vessel
