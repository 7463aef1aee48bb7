// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "angio/registration/xray_view.hpp"

namespace angio::registration {

/// How far the projection of a centred tree moves in a view between two poses, rms over the points [px].
/// @param points_centered  3 x N [m]. The poses are those of the first view.
inline double projectedMotion_px(const Eigen::Matrix3Xd& points_centered, const XrayView& view, const Pose& T_from,
                                 const Pose& T_to) {
  double squares = 0;
  int seen = 0;
  for (Eigen::Index i = 0; i < points_centered.cols(); ++i) {
    const auto from = view.camera.project(view.T_view_first * (T_from * points_centered.col(i)));
    const auto to = view.camera.project(view.T_view_first * (T_to * points_centered.col(i)));
    if (!from || !to) continue;
    squares += (*to - *from).squaredNorm();
    ++seen;
  }
  return std::sqrt(squares / std::max(1, seen));
}

}  // namespace angio::registration
